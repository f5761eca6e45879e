import type { ChargingPlan, Journey, Stop } from "../api/documents";
import { ENERGY, PERCENT, POWER } from "../model/units";
import { chargingPlan, clock, isOfOtherPlaces } from "../state/answer";
import { chooseRoad } from "../state/forecast";
import { answersAreOld, chargingPlans, chosenCharging, chosenRoad, journey } from "../state/journey";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";
import { Choice } from "./choice";
import { into } from "./parts";
import { StationActions } from "./station-panel";
import { chanceInFigures, clockText, rangeWithUnit } from "./wording";

/** Smaller differences between roads are none. */
const MIN_SHOWN_S = 30;
const MIN_SHOWN_WH = 10;

/** What a road is, such as "fastest"; a number where the service gives no label. */
export function labelOf({ roads }: Journey, index: number): string {
  const { journey: words } = text.value;
  const names: Record<string, string> = words.labels;
  const labels = (roads[index]?.labels ?? []).map((label) => names[label] ?? label);
  return labels.join(", ") || words.road(index + 1);
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
      : words[s > s0 ? "longer" : "shorter"](duration(Math.abs(s - s0))),
    Math.abs(wh - wh0) < MIN_SHOWN_WH
      ? words.sameEnergy
      : words[wh > wh0 ? "more" : "less"](shown(Math.abs(wh - wh0), ENERGY)),
  ];
  return parts.join(" · ");
}

/** The roads of a journey to choose from: the first with its time and energy, the others with what differs. */
function Roads({ of }: { of: Journey }) {
  const { shown } = format.value;
  const times = of.roads.map(({ whole }) => whole.duration_s);
  const energies = of.roads.map(({ whole }) => whole.energy_wh);
  const options = of.roads.map(
    ({ distance_m, whole }, k) =>
      [
        k,
        <>
          <b>{labelOf(of, k)}</b>
          <small>
            {figuresText(times, energies, k)} · {shown(distance_m, units.value.distance)}
            {whole.charges > 0 && ` · ${text.value.journey.stops(whole.charges)}`}
          </small>
          <small class="unseen">{chanceInFigures(whole.p_reserve)}</small>
        </>,
      ] as const,
  );
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
    ({ label, stops }, k) =>
      [
        k,
        <>
          <b>{names[label] ?? label}</b>
          <small>
            {words.stops(stops.length)} · {figuresText(times, energies, k)}
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

function StopRow({ of }: { of: Stop }) {
  const { journey: words } = text.value;
  const { shown, span } = format.value;
  const { station, if_full: full } = of;
  const at = clock.value;
  const known = station.power_known ? "" : ` (${text.value.map.assumed})`;
  const names: Record<string, string> = words.plugs;
  const plug = station.plug in names ? ` · ${names[station.plug]}` : "";
  const power = station.power_w > 0 ? `${plug} · ${shown(station.power_w, POWER)}${known}` : plug;
  const after = at && new Date(at.leaves.getTime() + of.arrives_after_s * 1000);
  return (
    <li>
      <h4>
        {station.name || words.station}
        <span class="figures">
          {power}
          {` · ${shown(of.position_m, units.value.distance, 0)}`}
          {after && ` · ${clockText(after, at.leaves)}`}
        </span>
      </h4>
      <p>
        <b>
          {words.chargeFor(shown(of.soc_arrival, PERCENT), shown(of.soc_leave, PERCENT), span(of.charging_s))}
        </b>{" "}
        <span class="figures">
          {words.arriveThere(rangeWithUnit(of.soc_interval, PERCENT))} ·{" "}
          {words.reached(chanceInFigures(of.p_reach))}
          {of.preheat && ` · ${words.preheat}`}
          {of.needed_below < 1 &&
            ` · ${words.neededBelow(`${Math.ceil(PERCENT.from(of.needed_below))}\u00a0%`)}`}
        </span>
      </p>
      <p class="note">
        {full
          ? words.ifFull(
              full.station.name || words.station,
              shown(full.soc_arrival, PERCENT),
              full.more_s < MIN_SHOWN_S ? words.sameTime : words.longer(span(full.more_s)),
              chanceInFigures(full.p_reach),
            )
          : words.noneIfFull}
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
          {plan.stops.map((stop) => (
            <StopRow key={stop.position_m} of={stop} />
          ))}
        </ol>
      )}
      {roads && plans.length > 0 && <h3>{words.roadsWithoutStops}</h3>}
      {roads}
    </section>
  );
}
