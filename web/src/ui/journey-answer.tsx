import type { ChargingPlan, Journey, Road, Stop } from "../api/documents";
import { hundredthsOf, verdictOf } from "../model/arrival";
import { BELOW } from "../model/answer";
import { HERE_M, leadsElsewhere } from "../model/stations";
import { ENERGY, PERCENT } from "../model/units";
import { chargingPlan, halts, isOfOtherPlaces } from "../state/answer";
import { chooseRoad, requested } from "../state/forecast";
import { answersAreOld, chargingPlans, chosenCharging, chosenRoad, journey } from "../state/journey";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";
import { Choice } from "./choice";
import { into } from "./parts";
import { StationActions } from "./station-panel";
import {
  chanceInFigures,
  chargerParts,
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
/** So few of a hundred trips are none. */
const DOES_NOT = 5;

/** What a road is, such as "fastest"; a number where the service gives no label. */
export function labelOf({ roads }: Journey, index: number): string {
  const { journey: words } = text.value;
  const names: Record<string, string> = words.labels;
  const labels = roads[index]?.labels ?? [];
  return labels.map((label) => names[label] ?? label).join(", ") || words.road(index + 1);
}

/** Time and energy, or how they differ from those of the first one. */
function figuresText(times: readonly number[], energies: readonly number[], index: number): string {
  const { duration, shown } = format.value;
  const { journey: words } = text.value;
  const [s0 = 0, s = 0] = [times[0], times[index]];
  const [wh0 = 0, wh = 0] = [energies[0], energies[index]];
  if (index === 0) return `${duration(s)} · ${shown(wh, ENERGY)}`;
  const parts = [
    Math.abs(s - s0) < MIN_SHOWN_S
      ? words.sameTime
      : words[s > s0 ? "longer" : "less"](duration(Math.abs(s - s0))),
    Math.abs(wh - wh0) < MIN_SHOWN_WH
      ? words.sameEnergy
      : words[wh > wh0 ? "more" : "less"](shown(Math.abs(wh - wh0), ENERGY)),
  ];
  return parts.join(" · ");
}

/** How likely a road keeps the reserve, where that is in doubt. */
function Doubt({ chance }: { chance: number }) {
  const { journey, result } = text.value;
  const verdict = verdictOf(chance);
  if (verdict === "good") return <small class="unseen">{chanceInFigures(chance)}</small>;
  const isNone = hundredthsOf(chance).count < DOES_NOT;
  return (
    <small class={`chance-${verdict}`}>
      {isNone ? journey.doesNotArrive : result.glanceReserve(chanceInFigures(chance))}
    </small>
  );
}

/** The roads of a journey to choose from: the first with its time and energy, the others with what differs; of one that does not arrive there is nothing to gain. */
function Roads({ of }: { of: Journey }) {
  const { shown } = format.value;
  const times = of.roads.map(({ whole }) => whole.duration_s);
  const energies = of.roads.map(({ whole }) => whole.energy_wh);
  const options = of.roads.map((road: Road, k) => {
    const { whole, distance_m, charging = null } = road;
    const { course } = (k === 0 ? of.charging : charging) ?? {};
    const wayM = course?.position_m.at(-1) ?? distance_m;
    const figures = [
      verdictOf(whole.p_reserve) !== "bad" && figuresText(times, energies, k),
      shown(wayM, units.value.distance, wayM < 100_000 ? 1 : 0),
      whole.charges > 0 && text.value.journey.stops(whole.charges),
    ];
    return [
      k,
      <>
        <b>{labelOf(of, k)}</b>
        <small>{figures.filter(Boolean).join(" · ")}</small>
        <Doubt chance={whole.p_reserve} />
      </>,
    ] as const;
  });
  return (
    <Choice
      label={text.value.journey.roads}
      class="roads"
      value={chosenRoad.value}
      options={options}
      onChoose={chooseRoad}
    />
  );
}

/** Other plans of charging stops. */
function Plans({ plans }: { plans: ChargingPlan[] }) {
  const { journey: words } = text.value;
  const names: Record<string, string> = words.plans;
  const times = plans.map(({ duration_s }) => duration_s);
  const energies = plans.map(({ energy_wh }) => energy_wh);
  const options = plans.map(
    ({ label, stops, p_reserve }, k) =>
      [
        k,
        <>
          <b>{names[label] ?? label}</b>
          <small>
            {words.stops(stops.length)} · {figuresText(times, energies, k)} ·{" "}
            {text.value.result.glanceReserve(chanceInFigures(p_reserve))}
          </small>
        </>,
      ] as const,
  );
  return (
    <Choice
      label={words.chargingPlans}
      class="roads"
      value={chosenCharging.value}
      options={options}
      onChoose={into(chosenCharging)}
    />
  );
}

function StopRow({ of, isTold }: { of: Stop; isTold: boolean }) {
  const { journey: words } = text.value;
  const { duration, shown, span } = format.value;
  const { reserve } = requested.value.at;
  const { station, if_full: full } = of;
  const time = words.chargingTime(span(of.charging_s), of.pause_s > 0);
  const [at, day] = clockAfter(of.arrives_after_s);
  return (
    <li>
      <h4>
        {stationName(station)}
        <span class="figures">
          {chargerParts(station).map((part) => ` · ${part}`)}
          {` · ${shown(of.position_m, units.value.distance, 0)}`}
          {` · ${day} ${at}`}
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
          {of.needed_below <= of.soc_interval[1] && ` · ${words.neededBelow(upwards(of.needed_below))}`}
        </span>
      </p>
      <p class="note">
        {full
          ? words.ifFull(
              stationName(full.station),
              (full.soc_arrival < reserve ? words.only : String)(shown(full.soc_arrival, PERCENT)),
              full.more_s < MINUTE_S ? words.sameTime : words.longer(duration(full.more_s)),
              chanceInFigures(full.p_reach),
            )
          : !leadsElsewhere(chargingPlan.value, chargingPlans.value) && words.noOther}
      </p>
      <StationActions of={station} />
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
