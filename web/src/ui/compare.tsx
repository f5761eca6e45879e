import { batch } from "@preact/signals";
import type { Answer } from "../api/types";
import { chanceInFigures, chanceOf, emptyAfterM } from "../model/arrival";
import { hasMotorway } from "../model/links";
import { duration, ENERGY, figure, PERCENT, type Quantity, shown } from "../model/units";
import { type Conditions, change, conditions } from "../state/conditions";
import { asked, type Other, other } from "../state/forecast";
import { units } from "../state/preferences";
import { trip } from "../state/trip";
import { bandText } from "./result";
import { Slider } from "./slider";

interface Setting {
  label: string;
  quantity: () => Quantity;
  limits: [number, number];
  step: number;
  /** First and second side of its usual question. */
  usual: [number, number];
}

const KM_H = 1 / 3.6;

const SETTINGS: Record<Other["setting"], Setting> = {
  setpointDegc: {
    label: "Cabin",
    quantity: () => units.value.temperature,
    limits: [15, 28],
    step: 1,
    usual: [22, 18],
  },
  ambientDegc: {
    label: "Outside",
    quantity: () => units.value.temperature,
    limits: [-25, 45],
    step: 1,
    usual: [20, -5],
  },
  payloadKg: { label: "Load", quantity: () => units.value.mass, limits: [0, 500], step: 10, usual: [0, 300] },
  soc: {
    label: "Battery at departure",
    quantity: () => PERCENT,
    limits: [0.05, 1],
    step: 1,
    usual: [0.8, 0.6],
  },
  motorwayMS: {
    label: "Motorway speed",
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
  const { label, quantity, limits, step } = SETTINGS[setting];
  return (
    <div class="compare-controls">
      <div class="questions">
        {settingsOfTrip().map((name) => {
          const { label, quantity, usual } = SETTINGS[name];
          const sides = name === setting ? [conditions.value[name] ?? usual[0], value] : usual;
          const [first, second] = sides.map((si) => figure(quantity().from(si), 0));
          return (
            <button key={name} type="button" aria-pressed={name === setting} onClick={() => ask(name)}>
              {label}{" "}
              <span class="figures">
                {first} or {second}
                {"\u00a0"}
                {quantity().unit}
              </span>
            </button>
          );
        })}
      </div>
      <Slider
        label={`${label}, second side`}
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
  return (
    <div class={`side side-${kind}`}>
      <h3>{name}</h3>
      <p class="number">
        {figure(Math.max(PERCENT.from(of.soc_arrival), 0), 0)}
        <small>%</small>
      </p>
      <p class="figures">
        {emptyM === null
          ? `${bandText(of)} in 9 of 10 trips`
          : `Empty after about ${shown(emptyM, units.value.distance, 0)}`}
      </p>
      <p class="figures">
        {shown(of.energy_wh, ENERGY)} · {duration(of.series.time_s.at(-1) as number)}
      </p>
      {chance !== null && <p class="figures">Keeps the reserve in {chanceInFigures(chance)}</p>}
    </div>
  );
}

/** The difference as a sentence. */
export function differenceText(first: Answer, second: Answer, names: [string, string]): string {
  const saved = first.energy_wh - second.energy_wh;
  const points = PERCENT.from(second.soc_arrival - first.soc_arrival);
  const later = (second.series.time_s.at(-1) as number) - (first.series.time_s.at(-1) as number);
  const [less, than] = points >= 0 ? [names[1], names[0]] : names;
  const time =
    Math.abs(later) >= 30
      ? ` and takes ${duration(Math.abs(later))} ${later > 0 === points >= 0 ? "longer" : "less"}`
      : "";
  const energy = Math.abs(saved) >= 5 ? ` and ${shown(Math.abs(saved), ENERGY)} less` : "";
  return `${less} rather than ${than}: ${figure(Math.abs(points), 1)} points more battery on arrival${energy}${time}.`;
}

export function CompareLine({ first, second }: { first: Answer; second: Answer }) {
  const { setting, value } = asked.value.other;
  const { quantity, label } = SETTINGS[setting];
  const at = asked.value.at[setting];
  const names: [string, string] = [
    at === null ? "As planned" : shown(at, quantity()),
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
