import { batch } from "@preact/signals";
import type { Answer } from "../api/types";
import { chanceOf, emptyAfterM } from "../model/arrival";
import { hasMotorway } from "../model/links";
import { ENERGY, PERCENT, type Quantity } from "../model/units";
import { type Conditions, change, conditions } from "../state/conditions";
import { asked, type Other, other } from "../state/forecast";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";
import { Slider } from "./slider";
import { bandText, chanceInFigures } from "./wording";

interface Setting {
  quantity: () => Quantity;
  limits: [number, number];
  step: number;
  /** First and second side of its usual question. */
  usual: [number, number];
}

const KM_H = 1 / 3.6;
/** Smaller differences are not told. */
const LEAST_SAVED_WH = 5;
const LEAST_LONGER_S = 30;

const SETTINGS: Record<Other["setting"], Setting> = {
  setpointDegc: {
    quantity: () => units.value.temperature,
    limits: [15, 28],
    step: 1,
    usual: [22, 18],
  },
  ambientDegc: {
    quantity: () => units.value.temperature,
    limits: [-25, 45],
    step: 1,
    usual: [20, -5],
  },
  payloadKg: { quantity: () => units.value.mass, limits: [0, 500], step: 10, usual: [0, 300] },
  soc: {
    quantity: () => PERCENT,
    limits: [0.05, 1],
    step: 1,
    usual: [0.8, 0.6],
  },
  motorwayMS: {
    quantity: () => units.value.speed,
    limits: [80 * KM_H, 150 * KM_H],
    step: 5,
    usual: [130 * KM_H, 110 * KM_H],
  },
};

function settingsOfTrip(): Other["setting"][] {
  const all = Object.keys(SETTINGS) as Other["setting"][];
  const links = trip.value?.links;
  return links && hasMotorway(links) ? all : all.filter((name) => name !== "motorwayMS");
}

function ask(setting: Other["setting"]): void {
  const [first, value] = SETTINGS[setting].usual;
  batch(() => {
    change({ [setting]: first } as Partial<Conditions>);
    other.value = { setting, value };
  });
}

export function CompareControls() {
  const { setting, value } = other.value;
  const { quantity, limits, step } = SETTINGS[setting];
  const { compare, settings } = text.value;
  return (
    <div class="compare-controls">
      <div class="questions">
        {settingsOfTrip().map((name) => {
          const { quantity, usual } = SETTINGS[name];
          const sides = name === setting ? [conditions.value[name] ?? usual[0], value] : usual;
          const [first, second] = sides.map((si) => format.value.figure(quantity().from(si), 0)) as [
            string,
            string,
          ];
          return (
            <button key={name} type="button" aria-pressed={name === setting} onClick={() => ask(name)}>
              {settings[name].label}{" "}
              <span class="figures">{`${compare.or(first, second)}\u00a0${quantity().unit}`}</span>
            </button>
          );
        })}
      </div>
      <Slider
        label={compare.second(settings[setting].label)}
        value={value}
        least={limits[0]}
        most={limits[1]}
        step={step}
        quantity={quantity()}
        onChange={(si) => {
          other.value = { setting, value: si };
        }}
      />
    </div>
  );
}

function Side({ of, kind, name }: { of: Answer; kind: "main" | "other"; name: string }) {
  const chance = chanceOf(of, asked.value.at.reserve);
  const emptyM = emptyAfterM(of);
  const { figure, shown, duration } = format.value;
  const { result, compare } = text.value;
  return (
    <div class={`side side-${kind}`}>
      <h3>{name}</h3>
      <p class="number">
        {figure(Math.max(PERCENT.from(of.soc_arrival), 0), 0)}
        <small>%</small>
      </p>
      <p class="figures">
        {emptyM === null
          ? result.inTrips(bandText(of))
          : result.emptyAfter(shown(emptyM, units.value.distance, 0))}
      </p>
      <p class="figures">
        {shown(of.energy_wh, ENERGY)} · {duration(of.series.time_s.at(-1) as number)}
      </p>
      {chance !== null && <p class="figures">{compare.keeps(chanceInFigures(chance))}</p>}
    </div>
  );
}

/** The difference as a sentence, from the forecast that arrives with more. */
function differenceText(first: Answer, second: Answer, names: [string, string]): string {
  const { figure, shown, duration } = format.value;
  const { compare } = text.value;
  const points = PERCENT.from(second.soc_arrival - first.soc_arrival);
  const [one, other] = points >= 0 ? [second, first] : [first, second];
  const [name, otherName] = points >= 0 ? [names[1], names[0]] : names;
  const savedWh = other.energy_wh - one.energy_wh;
  const longerS = (one.series.time_s.at(-1) as number) - (other.series.time_s.at(-1) as number);
  const parts = [compare.morePoints(figure(Math.abs(points), 1))];
  if (savedWh >= LEAST_SAVED_WH) parts.push(compare.lessEnergy(shown(savedWh, ENERGY)));
  if (longerS >= LEAST_LONGER_S) parts.push(compare.longer(duration(longerS)));
  if (longerS <= -LEAST_LONGER_S) parts.push(compare.shorter(duration(-longerS)));
  return `${compare.instead(name, otherName)}: ${parts.join(", ")}.`;
}

export function CompareLine({ first, second }: { first: Answer; second: Answer }) {
  const { setting, value } = asked.value.other;
  const { quantity } = SETTINGS[setting];
  const { shown } = format.value;
  const { compare, settings } = text.value;
  const { label } = settings[setting];
  const at = asked.value.at[setting];
  const names: [string, string] = [
    at === null ? compare.asPlanned : shown(at, quantity()),
    shown(value, quantity()),
  ];
  return (
    <div class="comparison">
      <div class="sides">
        <Side of={first} kind="main" name={`${label} ${names[0]}`} />
        <Side of={second} kind="other" name={`${label} ${names[1]}`} />
      </div>
      <p class="difference">{differenceText(first, second, names)}</p>
    </div>
  );
}
