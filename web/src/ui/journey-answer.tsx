import type { ChargingPlan, Journey, Road, Stop, Whole } from "../api/documents";
import { verdictOf } from "../model/arrival";
import { BELOW } from "../model/answer";
import { HERE_M, planWithout } from "../model/stations";
import { ENERGY, PERCENT } from "../model/units";
import { chargingPlan, halts, isOfOtherPlaces } from "../state/answer";
import { chooseRoad } from "../state/forecast";
import { answersAreOld, chargingPlans, chosenCharging, chosenRoad, journey } from "../state/journey";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";
import { Choice } from "./choice";
import { into } from "./parts";
import { StationActions } from "./station-panel";
import {
  chanceInFigures,
  chargerParts,
  chargingText,
  clockAfter,
  rangeWithUnit,
  stationName,
  turnText,
  upwards,
} from "./wording";

/** Smaller differences between roads are none. */
const MIN_SHOWN_S = 30;
const MINUTE_S = 60;
const MIN_SHOWN_WH = 10;
/** With a smaller chance, a road does not arrive. */
const DOES_NOT = 0.045;

/** What a road is, such as "fastest"; a number where the service gives no label. */
export function labelOf({ roads }: Journey, index: number): string {
  const { journey: words } = text.value;
  const names: Record<string, string> = words.labels;
  const labels = roads[index]?.labels ?? [];
  return labels.map((label) => names[label] ?? label).join(", ") || words.road(index + 1);
}

/** Time and energy, or by how much they differ from those of the first one. */
function figuresText(whole: Whole, first: Whole): string[] {
  const { duration, shown } = format.value;
  const { journey: words } = text.value;
  const [s, wh] = [whole.duration_s - first.duration_s, whole.energy_wh - first.energy_wh];
  if (whole === first) return [duration(whole.duration_s), shown(whole.energy_wh, ENERGY)];
  return [
    Math.abs(s) < MIN_SHOWN_S ? "" : words[s > 0 ? "longer" : "less"](duration(Math.abs(s))),
    Math.abs(wh) < MIN_SHOWN_WH ? "" : words[wh > 0 ? "more" : "less"](shown(Math.abs(wh), ENERGY)),
  ];
}

/** How likely a road keeps the reserve, where that is in doubt. */
function Doubt({ chance }: { chance: number }) {
  const { journey, result } = text.value;
  const verdict = verdictOf(chance);
  if (verdict === "good") return <small class="unseen">{chanceInFigures(chance)}</small>;
  return (
    <small class={`chance-${verdict}`}>
      {chance < DOES_NOT ? journey.doesNotArrive : result.glanceReserve(chanceInFigures(chance))}
    </small>
  );
}

/** Its name, totals and length [m]. */
type Alternative = readonly [string, Whole, number];

/** Plans or roads to choose from, each once: the first with its time and energy, the others with what differs; of one that does not arrive there is nothing to gain. */
function alternatives(all: Alternative[]) {
  const { duration, shown } = format.value;
  const far = (wayM: number) => shown(wayM, units.value.distance, wayM < 100_000 ? 1 : 0);
  const looks = all.map(([, { charges, duration_s, soc_arrival }, wayM]) =>
    [far(wayM), charges, duration(duration_s), shown(soc_arrival, PERCENT)].join(),
  );
  const options = all.map(([name, whole, wayM], k) => {
    const figures = [
      ...(verdictOf(whole.p_reserve) === "bad" ? [] : figuresText(whole, (all[0] as Alternative)[1])),
      far(wayM),
      whole.charges > 0 && text.value.journey.stops(whole.charges),
    ];
    const label = (
      <>
        <b>{name}</b>
        <small>{figures.filter(Boolean).join(" · ")}</small>
        <Doubt chance={whole.p_reserve} />
      </>
    );
    return [k, label] as const;
  });
  const firstOf = (k: number) => looks.indexOf(looks[k] ?? "");
  return { firstOf, options: options.filter(([k]) => firstOf(k) === k) };
}

/** The roads of a journey to choose from. */
function Roads({ of }: { of: Journey }) {
  const { firstOf, options } = alternatives(
    of.roads.map(({ whole, distance_m, charging }: Road, k) => {
      const { course } = (k === 0 ? of.charging : charging) ?? {};
      return [labelOf(of, k), whole, course?.position_m.at(-1) ?? distance_m];
    }),
  );
  const { roads: label } = text.value.journey;
  const value = firstOf(chosenRoad.value);
  return <Choice label={label} class="roads" value={value} options={options} onChoose={chooseRoad} />;
}

/** Other plans of charging stops. */
function Plans({ plans }: { plans: ChargingPlan[] }) {
  const { chargingPlans: label, plans: names } = text.value.journey;
  const { firstOf, options } = alternatives(
    plans.map((plan) => {
      const whole = { ...plan, charges: plan.stops.length };
      return [names[plan.label], whole, plan.course.position_m.at(-1) ?? 0];
    }),
  );
  const value = firstOf(chosenCharging.value);
  return (
    <Choice label={label} class="roads" value={value} options={options} onChoose={into(chosenCharging)} />
  );
}

/** What to do if a station is occupied. */
export function occupiedText({ station, if_full: full }: Stop): string {
  const { journey: words } = text.value;
  const { duration, shown } = format.value;
  const other = planWithout(station, chargingPlans.value);
  if (!full) return other ? words.otherPlan(words.plans[other.label]) : words.noOther;
  return words.ifFull(
    stationName(full.station),
    shown(full.soc_arrival, PERCENT),
    full.more_s < MINUTE_S ? "" : words.longer(duration(full.more_s)),
    chanceInFigures(full.p_reach),
  );
}

function StopRow({ of, isTold }: { of: Stop; isTold: boolean }) {
  const { journey: words } = text.value;
  const { shown } = format.value;
  const time = chargingText(of);
  const [low, high] = of.soc_interval;
  const [at, day] = clockAfter(of.arrives_after_s);
  return (
    <li>
      <h4>
        {stationName(of.station)}
        <span class="figures">
          {chargerParts(of.station).map((part) => ` · ${part}`)}
          {` · ${shown(of.position_m, units.value.distance, 0)} · ${day} ${at}`}
        </span>
      </h4>
      <p>
        <b>{words.chargeFor(shown(of.soc_arrival, PERCENT), shown(of.soc_leave, PERCENT), time)}</b>
        <span class="figures">
          {of.position_m < HERE_M
            ? ` · ${words.here}`
            : !isTold &&
              ` · ${words.arriveThere(rangeWithUnit(of.soc_interval, PERCENT))} · ${words.reached(chanceInFigures(of.p_reach))}`}
          {of.preheat && ` · ${words.preheat}`}
          {of.needed_below > low &&
            of.needed_below <= high &&
            ` · ${words.neededBelow(upwards(of.needed_below))}`}
        </span>
      </p>
      <p class="note">{occupiedText(of)}</p>
      <StationActions of={of.station} />
    </li>
  );
}

/** What there is to choose of a journey: its charging stops, or its roads. */
export function JourneyAnswer() {
  const of = journey.value;
  if (!of || !trip.value?.stops) return null;
  const plan = chargingPlan.value;
  const plans = chargingPlans.value;
  const { journey: words } = text.value;
  const isOld = answersAreOld.value || isOfOtherPlaces.value;
  const roads = of.roads.length > 1 && <Roads of={of} />;
  if (plans.length === 0 && !roads) return null;
  return (
    <section class={`card choices${isOld ? " old" : ""}`} aria-labelledby="choices-title" aria-busy={isOld}>
      <h2 id="choices-title">{plans.length > 0 ? words.chargingStops : words.roads}</h2>
      {plan && plans.length > 1 && <Plans plans={plans} />}
      {plan && (
        <ol class="stops">
          {halts.value.map((one, k) =>
            "station" in one ? (
              <StopRow key={k} of={one} isTold={k === 0 && of.verdict.reason === BELOW} />
            ) : (
              <li key={k} class="turn">
                {turnText(one)}
              </li>
            ),
          )}
        </ol>
      )}
      {roads && plans.length > 0 && <h3>{words.roads}</h3>}
      {roads}
    </section>
  );
}
