import type { Journey, Stop, Whole } from "../api/documents";
import { BELOW, verdictOfAnswer } from "../model/answer";
import { chanceAtAll, verdictOf } from "../model/arrival";
import { HERE_M } from "../model/stations";
import { ENERGY, PERCENT } from "../model/units";
import { halts, isOfOtherPlaces } from "../state/answer";
import { chargingPlan, isSlow } from "../state/charging";
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
  isNeeded,
  turnText,
  upwards,
} from "./wording";

/** Smaller differences between roads are none. */
const MIN_SHOWN_S = 30;
const MIN_SHOWN_WH = 10;

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

/** How likely a road keeps the reserve, or arrives at all, where that is in doubt. */
function Doubt({ whole: { p_arrive, p_reserve } }: { whole: Alternative[1] }) {
  const { chance, journey, result } = text.value;
  const verdict = verdictOfAnswer({ pArrive: p_arrive, pReserve: p_reserve });
  if (verdict === "good") return <small>{chanceInFigures(p_reserve)}</small>;
  const reserve = p_reserve < 0.5 ? journey.below : result.glanceReserve(chanceInFigures(p_reserve));
  const arrives = p_arrive < 0.045 ? journey.doesNotArrive : chance.atAll(chanceInFigures(p_arrive));
  return <small class={`chance-${verdict}`}>{verdict === "open" ? reserve : arrives}</small>;
}

/** Its name, totals and length [m]. */
type Alternative = readonly [string, Whole & { p_arrive: number }, number];

interface WaysProps {
  label: string;
  all: Alternative[];
  chosen: number;
  onChoose: (index: number) => void;
}

/** Plans or roads to choose from, each once: the first with its time and energy, the others with what differs; of one that does not arrive there is nothing to gain. */
function Ways({ label, all, chosen, onChoose }: WaysProps) {
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
    const option = (
      <>
        <b>{name}</b>
        <small>{figures.filter(Boolean).join(" · ")}</small>
        <Doubt whole={whole} />
      </>
    );
    return [k, option] as const;
  });
  const firstOf = (k: number) => looks.indexOf(looks[k] ?? "");
  const once = options.filter(([k]) => firstOf(k) === k);
  return <Choice label={label} class="roads" value={firstOf(chosen)} options={once} onChoose={onChoose} />;
}

/** What to do if a station is occupied. */
export function occupiedText({ if_full: full, needed_below, pause_s }: Stop): string {
  const { journey: words } = text.value;
  if (!full && pause_s > 0) return words.laterInPause(upwards(needed_below));
  const { duration, shown } = format.value;
  if (!full) return words.noOther;
  return words.ifFull(
    stationName(full.station),
    shown(full.soc_arrival, PERCENT),
    full.more_s < MIN_SHOWN_S ? "" : words.longer(duration(full.more_s)),
    chanceInFigures(full.p_reach),
  );
}

function StopRow({ of, isTold }: { of: Stop; isTold: boolean }) {
  const { journey: words } = text.value;
  const { shown } = format.value;
  const [at, day] = clockAfter(of.arrives_after_s);
  const time = chargingText(of, true);
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
          {!isNeeded(of) && ` · ${words.neededBelow(upwards(of.needed_below))}`}
        </span>
      </p>
      {(of.if_full || of.pause_s > 0) && <p class="note">{occupiedText(of)}</p>}
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
  const allRoads = of.roads.map(({ whole, distance_m, charging: other, forecast }, k): Alternative => {
    const charging = k === 0 ? of.charging : other;
    const p_arrive = charging?.p_arrive ?? chanceAtAll(forecast);
    return [labelOf(of, k), { ...whole, p_arrive }, charging?.course.position_m.at(-1) ?? distance_m];
  });
  const roads = of.roads.length > 1 && !isSlow.value && (
    <Ways label={words.roads} all={allRoads} chosen={chosenRoad.value} onChoose={chooseRoad} />
  );
  const allPlans = plans.map((one): Alternative => {
    const whole = { ...one, charges: one.stops.length };
    return [words.plans[one.label], whole, one.course.position_m.at(-1) ?? 0];
  });
  if (plans.length === 0 && !roads) return null;
  return (
    <section class={`card choices${isOld ? " old" : ""}`} aria-labelledby="choices-title" aria-busy={isOld}>
      <h2 id="choices-title">{plans.length > 0 ? words.chargingStops : words.roads}</h2>
      {plans.length > 1 && (
        <Ways
          label={words.chargingPlans}
          all={allPlans}
          chosen={chosenCharging.value}
          onChoose={into(chosenCharging)}
        />
      )}
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
