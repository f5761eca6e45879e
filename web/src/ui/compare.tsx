import { batch } from "@preact/signals";
import type { Forecast, Whole } from "../api/documents";
import { arrivalBand, chanceOf, emptyAfterM } from "../model/arrival";
import { hasMotorway } from "../model/links";
import { ENERGY, PERCENT } from "../model/units";
import { type Conditions, change, conditions } from "../state/conditions";
import { difference, requested, type Other, other, wholes } from "../state/forecast";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";
import { settingOf } from "./settings";
import { Slider } from "./slider";
import { chanceInFigures, range, rangeWithUnit } from "./wording";

/** Smaller differences are left out of the sentence. */
const MIN_SHOWN_WH = 5;
const MIN_SHOWN_S = 30;
const MIN_SHOWN_POINTS = 0.05;

/** First and second value of each comparison when it is chosen. */
const USUAL_VALUES: Record<Other["setting"], [number, number]> = {
  cabin_setpoint_degc: [22, 18],
  ambient_temperature_degc: [20, -5],
  payload_mass_kg: [0, 300],
  soc: [0.8, 0.6],
  motorwayMS: [130 / 3.6, 110 / 3.6],
};

function settingsOfTrip(): Other["setting"][] {
  const all = Object.keys(USUAL_VALUES) as Other["setting"][];
  const links = trip.value?.links;
  return links && hasMotorway(links) ? all : all.filter((name) => name !== "motorwayMS");
}

/** The value of the page, where the comparison is with another one, and the other one. */
function sidesOf(setting: Other["setting"]): [number, number] {
  const [first, second] = USUAL_VALUES[setting];
  const now = conditions.value[setting];
  if (now === null || setting === "cabin_setpoint_degc") return [first, second];
  return [now, Math.abs(now - second) < 1e-6 ? first : second];
}

function compareBy(setting: Other["setting"]): void {
  const [first, value] = sidesOf(setting);
  batch(() => {
    change({ [setting]: first } as Partial<Conditions>);
    other.value = { setting, value };
  });
}

export function CompareControls() {
  const { setting, value } = other.value;
  const { compare, conditions: words } = text.value;
  return (
    <div class="compare-controls">
      <div class="questions">
        {settingsOfTrip().map((name) => {
          const { quantity } = settingOf(name);
          const usual = sidesOf(name);
          const sides = name === setting ? [conditions.value[name] ?? usual[0], value] : usual;
          const [first = "", second = ""] = sides.map((si) => format.value.figure(quantity.from(si), 0));
          return (
            <button key={name} type="button" aria-pressed={name === setting} onClick={() => compareBy(name)}>
              {words.fields[name]}{" "}
              <span class="figures">{`${compare.or(first, second)}\u00a0${quantity.unit}`}</span>
            </button>
          );
        })}
      </div>
      <Slider
        setting={setting}
        label={compare.second(words.fields[setting])}
        value={value}
        onChange={(si) => {
          other.value = { setting, value: si };
        }}
      />
    </div>
  );
}

interface SideProps {
  of: Forecast;
  whole: Whole | undefined;
  kind: "main" | "other";
  name: string;
}

type Totals = ReturnType<typeof totalsOf>;

/** What counts for a driver: of a journey with stops to charge the whole of it, else its forecast. */
function totalsOf(of: Forecast, whole: Whole | undefined) {
  if (whole) return { ...whole, chance: whole.p_reserve };
  const chance = chanceOf(of, requested.value.at.reserve);
  const { soc_arrival, energy_wh } = of;
  return { soc_arrival, energy_wh, duration_s: of.series.time_s.at(-1) as number, charges: 0, chance };
}

function Side({ of, whole, kind, name }: SideProps) {
  const { chance, charges, duration_s, energy_wh, soc_arrival } = totalsOf(of, whole);
  const emptyM = charges > 0 ? null : emptyAfterM(of);
  const { figure, shown, duration } = format.value;
  const { result, compare, journey } = text.value;
  return (
    <div class={`side side-${kind}`}>
      <h3>{name}</h3>
      <p class="number">
        {figure(Math.max(PERCENT.from(soc_arrival), 0), 0)}
        <small>%</small>
      </p>
      <p class="figures">
        {charges > 0
          ? journey.stops(charges)
          : emptyM === null
            ? result.inTrips(rangeWithUnit(arrivalBand(of), PERCENT))
            : result.emptyAfter(shown(emptyM, units.value.distance, 0))}
      </p>
      <p class="figures">
        {shown(energy_wh, ENERGY)} · {duration(duration_s)}
      </p>
      {chance !== null && <p class="figures">{compare.keeps(chanceInFigures(chance))}</p>}
    </div>
  );
}

/** The difference as a sentence; its subject is the forecast with more charge on arrival. */
function differenceText(first: Totals, second: Totals, names: [string, string]): string {
  const { figure, shown, duration } = format.value;
  const { compare, journey, result } = text.value;
  const points = PERCENT.from(second.soc_arrival - first.soc_arrival);
  const [one, other] = points >= 0 ? [second, first] : [first, second];
  const [name, otherName] = points >= 0 ? [names[1], names[0]] : names;
  const savedWh = other.energy_wh - one.energy_wh;
  const longerS = one.duration_s - other.duration_s;
  const parts = Math.abs(points) < MIN_SHOWN_POINTS ? [] : [compare.morePoints(figure(Math.abs(points), 1))];
  if (savedWh >= MIN_SHOWN_WH) {
    const sign = points >= 0 ? -1 : 1;
    const ends = (difference.value?.interval_wh ?? []).map((wh) => sign * wh).sort((a, b) => a - b);
    const inTrips = ends.length > 0 ? ` (${result.inTrips(range(ends, ENERGY))})` : "";
    parts.push(compare.lessEnergy(shown(savedWh, ENERGY)) + inTrips);
  }
  if (longerS >= MIN_SHOWN_S) parts.push(journey.longer(duration(longerS)));
  if (longerS <= -MIN_SHOWN_S) parts.push(journey.less(duration(-longerS)));
  return `${compare.instead(name, otherName)}: ${parts.join(", ") || compare.noDifference}.`;
}

export function CompareLine({ first, second }: { first: Forecast; second: Forecast }) {
  const { setting, value } = requested.value.other;
  const { quantity } = settingOf(setting);
  const { shown } = format.value;
  const { compare, conditions: words } = text.value;
  const label = words.fields[setting];
  const [one, two] = wholes.value ?? [];
  const at = requested.value.at[setting];
  const names: [string, string] = [
    at === null ? compare.asPlanned : shown(at, quantity),
    shown(value, quantity),
  ];
  return (
    <div class="comparison">
      <div class="sides">
        <Side of={first} whole={one} kind="main" name={`${label} ${names[0]}`} />
        <Side of={second} whole={two} kind="other" name={`${label} ${names[1]}`} />
      </div>
      <p class="difference">{differenceText(totalsOf(first, one), totalsOf(second, two), names)}</p>
    </div>
  );
}
