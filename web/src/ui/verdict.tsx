/** The first thing that a driver reads: whether the trip arrives, with what, when, and what to do. */

import type { ChargingPlan, Forecast, Stop } from "../api/documents";
import { type Answer, decisiveChance, verdictOfAnswer } from "../model/answer";
import { emptyAfterM, type Verdict } from "../model/arrival";
import { warningsOf } from "../model/flags";
import { ENERGY, PERCENT } from "../model/units";
import { source } from "../state/catalogue";
import { answer, chargingPlan, clock, isLookingForStops, isOfOtherPlaces } from "../state/answer";
import { arrived, driving, shownForecast } from "../state/drive";
import { alternative, leaving, leavingIsOld, mode, problem, requested } from "../state/forecast";
import { answersAreOld, chargingPlans, journey } from "../state/journey";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";
import { Chance } from "./chance";
import { Climb } from "./climb";
import { CompareLine } from "./compare";
import { Failure, Waiting } from "./failure";
import { Icon } from "./icons";
import { NeedAnswer, needSentence, needVerdict } from "./need";
import { Stat } from "./parts";
import { ShareTools } from "./share";
import { Warnings } from "./warnings";
import { clockText, range, rangeWithUnit } from "./wording";

/** Chances between these are an open question. */
const OPEN = [0.05, 0.95] as const;

/** What is said of a road without its charging stops. */
const EMPTY = "battery_empty";

/** A smaller charge is 0 % as it is shown. */
const SHOWN_SOC = 0.005;

/** The reason of a verdict that would be good if the heights of the road were known. */
const HEIGHTS = "unknown_heights";
/** The reserve counts from the first stop on. */
const BELOW = "leaves_below_reserve";

/** What the service names first about the journey that is shown. */
function reasonOfJourney(): string | undefined {
  return mode.value === "plan" && trip.value?.stops ? journey.value?.verdict.reason : undefined;
}

/** The verdict as it is coloured: no road of unknown heights is green. */
function shownVerdict(now: Answer): Verdict {
  const verdict = verdictOfAnswer(now);
  return verdict === "good" && reasonOfJourney() === HEIGHTS ? "open" : verdict;
}

/** The answer in a sentence. */
function sentence(now: Answer): string {
  const { verdict: words } = text.value;
  if (isLookingForStops.value) return words.looking;
  if (shownVerdict(now) === "good") {
    const isRound = trip.value?.isRound ?? false;
    if (now.charges > 0) return words.withStops(now.charges, isRound);
    return isRound ? words.arrivesBack : words.arrives;
  }
  if (reasonOfJourney() === HEIGHTS) return words.probably;
  if (now.pArrive >= OPEN[1]) return words.belowReserve;
  if (decisiveChance(now) >= 0.5) return words.perhaps;
  if (now.pArrive >= 0.5) return words.mostlyBelow;
  return now.charges > 0 ? words.notWithStops : words.not;
}

/** Where a battery that is expected to run empty does so, and what it lacks. */
function Empty({ of, afterM }: { of: Forecast; afterM: number }) {
  const { result } = text.value;
  const { figure, shown } = format.value;
  const { early, late } = of.empty_at_m;
  const { least, expected, most } = of.missing_wh;
  const best = of.series.displayed_soc_high.at(-1) as number;
  const { distance } = units.value;
  const ends =
    late === null ? "" : result.emptyBetween(figure(distance.from(early ?? 0), 0), shown(late, distance, 0));
  return (
    <>
      {result.emptyAfter(shown(afterM, distance, 0))}
      {ends}
      <span class="missing">{result.missing(shown(expected, ENERGY), range([least, most], ENERGY, 1))}</span>
      {best >= SHOWN_SOC && <span class="missing">{result.atBest(shown(best, PERCENT))}</span>}
    </>
  );
}

/** Clock time of arrival, time and energy of the whole trip. */
function Whole({ now }: { now: Answer }) {
  const { verdict: words, result } = text.value;
  const { duration, shown } = format.value;
  const at = clock.value;
  const km = shown(now.distanceM, units.value.distance, now.distanceM < 100_000 ? 1 : 0);
  return (
    <dl class="whole">
      {at && (
        <Stat label={words.arrivesAt}>
          {clockText(at.arrives, at.isNow ? at.leaves : new Date())}
          {at.isNow && <small>{words.leavingNow}</small>}
        </Stat>
      )}
      <Stat label={words.duration}>
        {duration(now.drivingS + now.chargingS)}
        <small>{now.chargingS > 0 ? words.ofItCharging(duration(now.chargingS)) : km}</small>
      </Stat>
      <Stat label={result.energy}>
        {shown(now.energyWh, ENERGY)}
        {now.chargingS > 0 && <small>{km}</small>}
      </Stat>
    </dl>
  );
}

/** What has to be known before the chance is read; null where nothing has. */
function reasonText(): string | null {
  const reason = reasonOfJourney();
  if (reason === HEIGHTS) return text.value.verdict.unknownHeights;
  if (reason === BELOW) {
    const reserve = format.value.shown(requested.value.at.reserve, PERCENT);
    return text.value.verdict.leavesBelow(reserve, chargingPlan.value !== null);
  }
  // the other reasons are of the plan that the verdict of the service is about
  const isFirst = chargingPlan.value !== null && chargingPlan.value === chargingPlans.value[0];
  const reasons: Record<string, string> = text.value.verdict.reasonsWithStops;
  return (isFirst && reason && reasons[reason]) || null;
}

function Headline({ of, now, isOld }: { of: Forecast; now: Answer; isOld: boolean }) {
  const emptyM = chargingPlan.value ? null : emptyAfterM(of);
  const measured = driving.value && arrived.value;
  const { result } = text.value;
  const { figure } = format.value;
  const { reserve } = requested.value.at;
  const detail = measured ? result.measured : result.inTrips(rangeWithUnit(now.interval, PERCENT));
  return (
    <div class={`headline${isOld ? " old" : ""}`}>
      <p class="arrival">
        <span class="label">{result.onArrival}</span>
        <span class="number">
          {figure(emptyM === null ? PERCENT.from(now.soc) : 0, 0)}
          <small>{PERCENT.unit}</small>
        </span>
        <span class="range">{emptyM === null ? detail : <Empty of={of} afterM={emptyM} />}</span>
      </p>
      <Whole now={now} />
      {!measured && reasonText() && <p class="reason">{reasonText()}</p>}
      {!measured && (
        <div class="chance-box">
          <Chance
            verdict={shownVerdict(now)}
            chance={decisiveChance(now)}
            reserve={now.pReserve === null ? 0 : reserve}
            atAll={now.pArrive}
          />
          {isOld && (
            <p class="chance chance-open other-places">
              <Icon name="warning" />
              <span>{text.value.verdict.otherPlaces(trip.value?.title ?? "")}</span>
            </p>
          )}
        </div>
      )}
    </div>
  );
}

/** Until the charging stops are there: what is known without them. */
function Looking({ now }: { now: Answer }) {
  return (
    <div class="looking">
      <p>{text.value.verdict.needsCharging}</p>
      <div class="old">
        <Whole now={now} />
      </div>
    </div>
  );
}

/** The charge to leave with in words; rounded up. */
function leaveText(needed: number, stops: number, reserve: number): string {
  const { shown } = format.value;
  const { journey: words } = text.value;
  const upwards = (soc: number) => shown(Math.ceil(soc * 100 - 1e-6) / 100, PERCENT);
  if (stops > 0) return words.leaveWithout(upwards(needed));
  const left = shown(reserve, PERCENT);
  if (needed > 1) return words.notEnough(upwards(needed - 1), left);
  return needed > 0 ? words.leaveWith(upwards(needed), left) : words.anyCharge(left);
}

function stopText({ station, charging_s, soc_arrival, soc_leave }: Stop): string {
  const { shown, span } = format.value;
  const { journey: words } = text.value;
  const name = station.name || words.station;
  return words.charge(name, span(charging_s), shown(soc_arrival, PERCENT), shown(soc_leave, PERCENT));
}

/** Several charging stops in a line that names the first one, with all of them behind it. */
function Stops({ of }: { of: ChargingPlan }) {
  const { verdict: words, journey } = text.value;
  const { duration, shown } = format.value;
  const [first] = of.stops;
  if (!first || of.stops.length === 1) return first ? <li>{stopText(first)}</li> : null;
  const far = shown(first.position_m, units.value.distance, 0);
  const name = first.station.name || journey.station;
  const soc = shown(first.soc_leave, PERCENT);
  return (
    <li class="folded">
      <details>
        <summary>{words.stops(of.stops.length, duration(of.charging_s), name, far, soc)}</summary>
        <ol>
          {of.stops.map((stop) => (
            <li key={stop.position_m}>{stopText(stop)}</li>
          ))}
        </ol>
      </details>
    </li>
  );
}

/** What to do. */
function ToDo() {
  const isJourney = !!trip.value?.stops;
  const needed = isJourney ? journey.value?.soc_needed : leaving.value?.soc_needed;
  if (needed === undefined || driving.value || mode.value !== "plan") return null;
  const isOld = isJourney ? answersAreOld.value || isOfOtherPlaces.value : leavingIsOld.value;
  const { journey: words } = text.value;
  const speed = isJourney ? journey.value?.motorway_speed_m_s : null;
  const stops = chargingPlan.value?.stops.length ?? 0;
  const texts = [
    ...(stops === 0 || needed <= 1 ? [leaveText(needed, stops, requested.value.at.reserve)] : []),
    ...(speed != null && speed > 0
      ? [(stops > 0 ? words.atMostWithout : words.atMost)(format.value.shown(speed, units.value.speed, 0))]
      : []),
  ];
  return (
    <ul class={`journey-answer todo${isOld ? " old" : ""}`} aria-busy={isOld}>
      {chargingPlan.value && <Stops of={chargingPlan.value} />}
      {texts.map((one) => (
        <li key={one}>{one}</li>
      ))}
    </ul>
  );
}

/** How sure the answer is in a line, with what it rests on behind it; what would change the answer stands above. */
function HowSure({ of, now }: { of: Forecast; now: Answer }) {
  const others = mode.value === "compare" ? (alternative.value?.flags ?? []) : [];
  const chance = decisiveChance(now);
  const isOpen = chance > OPEN[0] && chance < OPEN[1];
  const wording = { text: text.value, format: format.value, units: units.value };
  const { verdict: words, result } = text.value;
  const ofRoad = of.flags.filter(({ code }) => !chargingPlan.value || code !== EMPTY);
  const flags = [...ofRoad, ...(journey.value?.flags ?? [])];
  const count = warningsOf(flags, wording).length;
  const planned = trip.value?.links ?? trip.value?.stops;
  return (
    <>
      {isOpen && <Warnings flags={flags} others={others} serious />}
      <details class="sure">
        <summary>
          <b>{words.sure}</b>{" "}
          {now.interval[1] >= SHOWN_SOC && result.inTrips(rangeWithUnit(now.interval, PERCENT))}
          {count > 0 && ` · ${words.reasons(count)}`}
        </summary>
        <p class="given">
          {planned ? result.givenPlanned : result.givenDriven} <Climb of={of} />
        </p>
        <Warnings flags={flags} others={others} serious={isOpen ? false : null} />
      </details>
    </>
  );
}

/** The verdict of the page's trip, or what a distance needs. */
export function VerdictCard() {
  const of = shownForecast.value;
  const now = answer.value;
  const { verdict: words } = text.value;
  const isDistance = source.value === "distance";
  const verdict = isDistance ? needVerdict() : of && now && shownVerdict(now);
  const shown = !isDistance && of && now;
  const isOther = !isDistance && isOfOtherPlaces.value;
  const isCompared = mode.value === "compare" && alternative.value !== null;
  return (
    <section
      class={`card verdict${verdict && !isOther && !isLookingForStops.value ? ` verdict-${verdict}` : ""}`}
      aria-labelledby="verdict-title"
      aria-busy={!shown && !isDistance}
    >
      <div class="heading">
        <h2 id="verdict-title">
          {isDistance ? needSentence() : shown && !isCompared && !isOther ? sentence(now) : words.title}
        </h2>
        {trip.value && <ShareTools />}
      </div>
      <Failure />
      {isDistance && <NeedAnswer />}
      {shown && isCompared && alternative.value && <CompareLine first={of} second={alternative.value} />}
      {shown && !isCompared && !isLookingForStops.value && <Headline of={of} now={now} isOld={isOther} />}
      {shown && !isLookingForStops.value && <ToDo />}
      {shown && !isLookingForStops.value && <HowSure of={of} now={now} />}
      {shown && isLookingForStops.value && <Looking now={now} />}
      {!shown && !isDistance && !problem.value && <Waiting />}
    </section>
  );
}
