/** The first thing that a driver reads: whether the trip arrives, with what, when, and what to do. */

import { computed } from "@preact/signals";
import { Fragment } from "preact";
import type { ChargingPlan, Forecast, Place, Station, Stop } from "../api/documents";
import { type Answer, BELOW, decisiveChance, verdictOfAnswer } from "../model/answer";
import {
  arrivalBand,
  chanceAtAll,
  chanceOf,
  emptyAfterM,
  socFromEnergy,
  type Verdict,
} from "../model/arrival";
import { isBetter } from "../model/diary";
import { warningsOf } from "../model/flags";
import { metresBetween } from "../model/road";
import { HERE_M, isSame, placeOfStation, STATION_KIND } from "../model/stations";
import { ENERGY, PERCENT } from "../model/units";
import { source } from "../state/catalogue";
import { car } from "../state/car";
import { conditions } from "../state/conditions";
import {
  answer,
  chargesHere,
  clock,
  halts,
  isLate,
  isLookingForStops,
  isOfOtherPlaces,
  lowestStop,
  stopInDoubt,
  turn,
} from "../state/answer";
import { chargingPlan, GENTLE_M_S, isLow, isSlow, ways, waysTo, wayTo } from "../state/charging";
import { arrived, driving, shownForecast } from "../state/drive";
import { alternative, leaving, leavingIsOld, mode, problem, requested } from "../state/forecast";
import {
  answersAreOld,
  askJourney,
  chosenRoad,
  journey,
  map,
  nearestStation,
  roadPoints,
} from "../state/journey";
import { ownCars } from "../state/own-cars";
import { format, text, units, wording } from "../state/preferences";
import { journeyRequest, type Trip, trip } from "../state/trip";
import { Chance } from "./chance";
import { Climb } from "./climb";
import { CompareLine } from "./compare";
import { Failure, Waiting } from "./failure";
import { occupiedText } from "./journey-answer";
import { NeedAnswer, needSentence, needVerdict } from "./need";
import { Stat, useAsked } from "./parts";
import { ShareTools } from "./share";
import { Warnings } from "./warnings";
import {
  bandText,
  chanceInFigures,
  chargingText,
  clockAfter,
  clockParts,
  range,
  rangeWithUnit,
  SHOWN_SOC,
  stationName,
  leastText,
  riseText,
  turnText,
  upwards,
  upwardsSoc,
} from "./wording";

/** Chances between these are an open question. */
const OPEN = [0.05, 0.95] as const;

/** A place far from its road, among the flags of a journey. */
const FAR = "far_from_road";

/** What is said of a road without its charging stops, and of a plan that is driven as usual. */
const EMPTY = "battery_empty";
const BEST_EFFORT = "no_stop_found";

/** From this chance on a trip arrives probably. */
const PROBABLE = 0.8;

/** Nearer places are told with a digit more [m]. */
const NEAR_M = 10_000;

/** A station that is nearer than this is said to be here, and a shorter detour is none [m]. */
const HEREABOUTS_M = 1000;
/** Less charge to leave with is told from this on. */
const FEW_SOC = 0.05;

/** The reason of a verdict that would be good if the heights of the road were known. */
const HEIGHTS = "unknown_heights";

/** What the service names first about the journey that is shown. */
function reasonOfJourney(): string | undefined {
  return mode.value === "plan" && trip.value?.stops ? journey.value?.verdict.reason : undefined;
}

/** Whether the first stop is reached slowly, and hardly as usual. */
function hasToBeSlow(): boolean {
  return isSlow.value && !!ways.value && chanceAtAll(ways.value.usual) < OPEN[1];
}

/** The verdict as it is coloured: no road of unknown heights is green, and none that has to be driven slowly. */
function shownVerdict(now: Answer): Verdict {
  const verdict = verdictOfAnswer(now);
  const isOpen = reasonOfJourney() === HEIGHTS || hasToBeSlow();
  return verdict === "good" && isOpen ? "open" : verdict;
}

/** The answer in a sentence. */
function sentence(now: Answer): string {
  const { verdict: words } = text.value;
  if (isLookingForStops.value) return words.looking;
  const of = isStuck.value ? shownForecast.value : null;
  const emptyM = of && emptyAfterM(of);
  if (of && emptyM !== null) return words.doNotSetOut(lastsText(of, emptyM));
  const first = chargingPlan.value?.stops[0];
  const isBelow = reasonOfJourney() === BELOW;
  if (first && hasToBeSlow() && now.pArrive >= OPEN[1]) return words.slowly(stationName(first.station));
  if (chargesHere.value && shownVerdict(now) === "good") return words.hereFirst;
  if (first && isBelow && shownVerdict(now) === "good") return words.thereFirst(farText(first.position_m));
  const isRound = (trip.value?.pauseS ?? null) !== null;
  const stops = now.charges > 0 ? words.withStops(now.charges) : "";
  if (shownVerdict(now) === "good") return (isRound ? words.arrivesBack : words.arrives) + stops;
  const probably = (isRound ? words.probablyBack : words.probably) + stops;
  if (reasonOfJourney() === HEIGHTS) return probably;
  const stop = stopInDoubt.value;
  if (stop && now.pArrive >= 0.5) {
    const name = stationName(stop.station);
    return now.pArrive < OPEN[1] ? words.stopMissed(name) : words.stopBelow(name, stop.p_reach < 0.5);
  }
  if (now.pArrive >= OPEN[1]) return words.belowReserve;
  if (decisiveChance(now) >= PROBABLE) return probably;
  if (now.pArrive >= 0.5) return words.perhaps;
  if (now.charges > 0) return words.notWithStops;
  return now.pArrive >= OPEN[0] ? words.probablyNot : words.not;
}

/** How far a battery lasts that is expected to run empty, with the interval where it surely does. */
function lastsText({ empty_at_m: { early, late } }: Forecast, afterM: number): string {
  const { figure, shown } = format.value;
  const { distance } = units.value;
  const far = shown(afterM, distance, 0);
  if (late === null) return far;
  return far + text.value.result.emptyBetween(figure(distance.from(early ?? 0), 0), shown(late, distance, 0));
}

/** Where a battery that is expected to run empty does so, and what it lacks. */
function Empty({ of, afterM }: { of: Forecast; afterM: number }) {
  const { result } = text.value;
  const { shown } = format.value;
  const { least, expected, most } = of.missing_wh;
  return (
    <>
      {result.emptyAfter(lastsText(of, afterM))}
      <span class="missing">
        {result.missing(shown(expected, ENERGY, 1), range([least, most], ENERGY, 1))}
      </span>
    </>
  );
}

/** Clock time of arrival, time and energy of the whole trip; no arrival where the battery is empty before. */
function Whole({ now, isEmpty }: { now: Answer; isEmpty: boolean }) {
  const { verdict: words, result } = text.value;
  const { duration, shown } = format.value;
  const at = clock.value;
  const [time, day] = at ? clockParts(at.arrives, at.isNow ? at.leaves : new Date()) : [];
  const leaves = at?.isNow && words[chargesHere.value ? "chargingNow" : "leavingNow"];
  const pluggedS = now.chargingS - now.overheadS;
  const alone = now.charges > 0 ? journey.value?.roads[chosenRoad.value] : undefined;
  const detourM = alone ? now.distanceM - alone.distance_m : 0;
  const far = shown(now.distanceM, units.value.distance, now.distanceM < 100_000 ? 1 : 0);
  const km = detourM < HEREABOUTS_M ? far : `${far}, ${text.value.journey.detour(farText(detourM))}`;
  const parts = [
    turn.value?.pauseS && words.ofItPause(duration(turn.value.pauseS)),
    pluggedS > 0 && words.ofItCharging(duration(pluggedS), duration(now.overheadS)),
  ].filter(Boolean);
  return (
    <dl class="whole">
      {at && !isEmpty && (
        <Stat label={turn.value ? words.backAt : words.arrivesAt}>
          {time}
          <small>{[day, leaves].filter(Boolean).join(", ")}</small>
        </Stat>
      )}
      <Stat label={isLookingForStops.value ? words.drivingAlone : words.duration}>
        {duration(now.drivingS + now.chargingS)}
        <small>{parts.join(", ") || km}</small>
      </Stat>
      <Stat label={result.energy}>
        {shown(now.energyWh, ENERGY)}
        {parts.length > 0 && <small>{km}</small>}
      </Stat>
    </dl>
  );
}

/** What has to be known before the chance is read; null where nothing has. */
function reasonText(): string | null {
  const reason = reasonOfJourney();
  if (reason === HEIGHTS) return text.value.verdict.unknownHeights;
  if (reason !== BELOW || chargesHere.value) return null; // who charges first leaves with more
  return text.value.verdict.leavesBelow(format.value.shown(requested.value.at.reserve, PERCENT));
}

function Headline({ of, now }: { of: Forecast; now: Answer }) {
  const emptyM = chargingPlan.value ? null : emptyAfterM(of);
  const measured = driving.value && arrived.value;
  const { result } = text.value;
  const { figure, shown } = format.value;
  const onArrival = turn.value ? result.whenBack : result.onArrival;
  const stop = lowestStop.value;
  const aside = stop && `${onArrival}: ${shown(now.soc, PERCENT)} (${rangeWithUnit(now.interval, PERCENT)})`;
  const label = stop ? result.atStop(stationName(stop.station)) : onArrival;
  const interval = bandText(stop?.soc_interval ?? now.interval);
  const [low = 0] = stop?.soc_interval ?? now.interval;
  const detail = measured ? result.measured : low < SHOWN_SOC ? interval : result.inTrips(interval);
  const chance = !measured && (
    <Chance
      verdict={shownVerdict(now)}
      chance={decisiveChance(now)}
      reserve={now.pReserve === null ? 0 : requested.value.at.reserve}
      atAll={now.pArrive}
      of={now.charges === 0 ? "end" : reasonOfJourney() === BELOW ? "fromFirst" : "stops"}
    />
  );
  if (isStuck.value && emptyM !== null) return <div class="headline">{chance}</div>;
  return (
    <div class="headline">
      <p class="arrival">
        <span class="label">{label}</span>
        <span class="number">
          {figure(emptyM === null ? PERCENT.from(stop?.soc_arrival ?? now.soc) : 0, 0)}
          <small>{PERCENT.unit}</small>
        </span>
        <span class="range">{emptyM === null ? detail : <Empty of={of} afterM={emptyM} />}</span>
        {aside && <span class="missing">{aside}</span>}
      </p>
      <Whole now={now} isEmpty={emptyM !== null} />
      {!measured && reasonText() && <p class="reason">{reasonText()}</p>}
      {chance}
    </div>
  );
}

/** The charge to leave with in words, rounded up, with what is then expected on arrival. */
function leaveText(needed: number, of: Forecast): string {
  const { shown } = format.value;
  const { journey: words } = text.value;
  const left = shown(requested.value.at.reserve, PERCENT);
  const now = of.series.displayed_soc[0] as number;
  if (needed > 1) return words.notEnough;
  if (needed <= 0) return words.anyCharge(left);
  const full = shown(1, PERCENT);
  const least = upwards(needed) === full ? full : words.orMore(upwards(needed));
  if (isStuck.value) return words.chargeFirst(least, isLow.value);
  const isAll = upwards(needed) === upwards(now);
  if (isAll || (needed < now && now - needed < FEW_SOC)) return words.justEnough(upwards(now), !isAll);
  const expected = shown(Math.max(needed - now + socFromEnergy(of, of.energy_wh), 0), PERCENT);
  return words.leaveWith(least, expected, left);
}

/** Whether the trip does not arrive, and no charging stop helps. */
const isStuck = computed(() => {
  const now = answer.value;
  return now !== null && trip.value?.stops != null && now.charges === 0 && decisiveChance(now) < 0.5;
});

/** A distance to drive. */
function farText(farM: number): string {
  return format.value.shown(farM, units.value.distance, farM < NEAR_M ? 1 : 0);
}

/** A slow speed. */
function slowText(): string {
  return format.value.shown(GENTLE_M_S, units.value.speed, 0);
}

/** The name of a station, for an app that leads there. */
function StationLink({ of }: { of: Station }) {
  const at = `geo:${of.latitude_deg},${of.longitude_deg}`;
  if (!matchMedia("(hover:none)").matches) return stationName(of); // a computer opens no such link
  return (
    <a href={at} title={text.value.journey.navigate}>
      {stationName(of)}
    </a>
  );
}

/** Drive so far, charge so long. */
function StopText({ of, fromM }: { of: Stop; fromM: number }) {
  const { shown } = format.value;
  const { journey: words } = text.value;
  const time = chargingText(of);
  const [arrival = "", leave = ""] = [of.soc_arrival, of.soc_leave].map((soc) => shown(soc, PERCENT));
  const isHere = of.position_m - fromM < HERE_M;
  const pace = fromM === 0 && isSlow.value ? slowText() : "";
  return (
    <>
      {isHere ? words.chargeHere(fromM > 0) : words.driveTo(farText(of.position_m - fromM), pace)}
      <StationLink of={of.station} />
      {of.pause_s > 0
        ? words.inPause(leastText(of), leave, time)
        : (isHere ? words.forHere : words.forThere)(time, arrival, leave, ...clockAfter(of.arrives_after_s))}
    </>
  );
}

/** How likely the end of a way is reached, and with what charge. */
function reachOf(way: Forecast) {
  return [chanceInFigures(chanceAtAll(way)), bandText(arrivalBand(way))] as const;
}

/** What to do if a station is occupied; without another one in the plan, the nearest for who arrives with little. */
function Occupied({ of }: { of: Stop }) {
  const here = { ...placeOfStation(of.station, ""), kind: "" };
  const [low = 0, high = 0] = of.soc_interval;
  const at = { ...conditions.value, soc: low };
  const roadTo = async (to: Place) => (isSame(to, here) ? undefined : wayTo(to, at, here));
  const isPlanned = of.if_full !== null || of.pause_s > 0;
  const ask = async () => [isPlanned ? null : await nearestStation(here, roadTo).catch(() => null)] as const;
  const found = useAsked(ask, [JSON.stringify([here, at, car.value, isPlanned])]);
  const { lookingForOther, nextOther, onlyOther, reachedAtAll } = text.value.journey;
  if (!found) return <li>{lookingForOther}</li>;
  const { of: other, way } = found[0] ?? {};
  if (!other || !way || chanceAtAll(way.forecast) < OPEN[0]) return <li>{occupiedText(of)}</li>;
  const [name, chance] = [stationName(other), chanceAtAll(way.forecast)];
  const far = `${farText(way.distance_m)} (${format.value.duration(way.duration_s)})`;
  if (chance < PROBABLE) return <li>{onlyOther(name, far, chanceInFigures(chance))}</li>;
  const heights = way.elevation?.elevation_m ?? [];
  const end = trip.value?.stops?.at(-1) as Place;
  const isBack = metresBetween(other, end) > metresBetween(here, end);
  const rise = riseText((heights.at(-1) ?? 0) - (heights[0] ?? 0));
  const [least, most] = arrivalBand(way.forecast);
  const left = way.forecast.soc_arrival + of.soc_arrival - low; // of who arrives with what is expected
  const half = Math.hypot(most - least, high - low) / 2;
  const band = bandText([Math.max(left - half, least), left + half]);
  return <li>{`${nextOther(name, far, rise, isBack)} ${reachedAtAll(chanceInFigures(chance), band)}`}</li>;
}

/** What has to be known of the first stop, each as an item of the list. */
function FirstStop({ of, plan }: { of: Stop; plan: ChargingPlan }) {
  const { asUsual, orCall, reachedAtAll } = text.value.journey;
  const both = isSlow.value && ways.value;
  const isDoubtful = of.position_m >= HERE_M && reasonOfJourney() === BELOW;
  const usual = isDoubtful && ([chanceInFigures(of.p_reach), bandText(of.soc_interval)] as const);
  const reach = both ? reachOf(both.slow) : usual;
  return (
    <>
      {reach && (
        <li>
          {reachedAtAll(...reach)} {both && asUsual(...reachOf(both.usual))}
        </li>
      )}
      {Math.max(of.p_reach, plan.p_arrive) < OPEN[1] && <li>{orCall}</li>}
      <Occupied of={of} />
    </>
  );
}

/** Where the journey halts, each as an item of the list. */
function Halts({ plan }: { plan: ChargingPlan | null }) {
  return halts.value.map((one, k) => (
    <Fragment key={k}>
      <li>
        {"station" in one ? <StopText of={one} fromM={halts.value[k - 1]?.position_m ?? 0} /> : turnText(one)}
      </li>
      {plan && one === plan.stops[0] && <FirstStop of={one} plan={plan} />}
      {"station" in one && one.pause_s > 0 && one !== plan?.stops[0] && <li>{occupiedText(one)}</li>}
    </Fragment>
  ));
}

/** That no charging stop helps: of the station that the driver chose, why. */
function noHelpText({ stops }: Trip): string {
  const { journey: words } = text.value;
  const at = stops?.findIndex(({ kind }) => kind === STATION_KIND) ?? -1;
  const soc = journey.value?.roads[chosenRoad.value]?.stops[at - 1]?.displayed_soc;
  const name = stops?.[at]?.name ?? "";
  if (soc === undefined) return map.value?.stations === 0 ? words.noStations : words.noStopHelps;
  if (soc < SHOWN_SOC) return words.outOfReach(name);
  if (soc >= requested.value.at.reserve) return words.notBeyond(name);
  return words.tooLow(name, format.value.shown(soc, PERCENT));
}

/** That no charging stop helps, and which station is the nearest. */
function NoStop({ of, from }: { of: Trip; from: Place }) {
  const asked = JSON.stringify(journeyRequest(of, conditions.value, car.value));
  const nearest = useAsked(() => nearestStation(from, wayTo), [asked]);
  const isHere = nearest !== null && nearest.farM < HEREABOUTS_M;
  const way = isHere ? undefined : nearest?.way;
  const { journey: words } = text.value;
  const isOpen = way && chanceAtAll(way.forecast) < OPEN[1];
  const both = useAsked(async () => (isOpen && nearest ? waysTo(nearest.of) : null), [isOpen, asked]);
  const slow = both && chanceAtAll(both.slow) >= OPEN[0] && both.slow;
  const reached = way && words.reachedAtAll(...reachOf(way.forecast));
  return (
    <>
      {noHelpText(of)}{" "}
      {nearest && (
        <>
          {isHere ? words.stationHere : words.nearest} <StationLink of={nearest.of} />
          {isHere ? words.chargeThere : words.away(farText(way?.distance_m ?? nearest.farM), !!way)} {reached}{" "}
          {slow && words.gently(slowText(), ...reachOf(slow))}
        </>
      )}
    </>
  );
}

/** The charge to leave with for a plan with fewer stops: for none, or for those in the pause alone where the car now stops before. */
function ChargedFirst({ of, plan, needed }: { of: Trip; plan: ChargingPlan; needed: number | undefined }) {
  const pausing = plan.stops.findIndex(({ pause_s }) => pause_s > 0);
  const body = journeyRequest({ ...of, pauseS: null }, conditions.value, car.value);
  const ask = async () => (pausing > 0 ? askJourney(body, false) : null);
  const there = useAsked(ask, [pausing, JSON.stringify(body)]);
  const forecast = there?.roads[0]?.forecast;
  const least = forecast && there ? there.soc_needed + 0.01 : pausing > 0 ? undefined : needed; // the way back has its risk, too
  const roads = journey.value?.roads ?? [];
  const [frugal] = [...roads].sort((one, other) => one.forecast.energy_wh - other.forecast.energy_wh);
  const alone = forecast ? roads[chosenRoad.value] : frugal; // the charge needed is the least of all roads
  const { soc, reserve } = conditions.value;
  if (least === undefined || least > 1 || least <= soc || !alone) return null;
  const { journey: words } = text.value;
  const { duration, shown } = format.value;
  const lessS = plan.driving_s + plan.charging_s - alone.duration_s;
  const moreWh = (upwardsSoc(least) - soc) * alone.forecast.wh_per_display;
  const kept = (forecast && chanceOf(forecast, reserve)) ?? 0;
  const chances = [kept, forecast ? chanceAtAll(forecast) : 0].map(chanceInFigures) as [string, string];
  return (
    <>
      {forecast && (
        <strong>{words.notNow(shown(soc, PERCENT), shown(forecast.soc_arrival, PERCENT), ...chances)}</strong>
      )}
      <h3>{words.chargedFirst(upwards(least), shown(moreWh, ENERGY, 1))}</h3>
      <p>{words[forecast ? "onlyInPause" : "withoutStop"](pausing === 0 ? "" : duration(lessS))}</p>
    </>
  );
}

/** What to do. */
function ToDo({ of }: { of: Forecast }) {
  const isJourney = !!trip.value?.stops;
  const { soc_needed: ofFirst, motorway_speed_m_s: speed } = (isJourney && journey.value) || {};
  // what the service says of the charge is about the first road
  const needed = isJourney ? (chosenRoad.value === 0 ? ofFirst : undefined) : leaving.value?.soc_needed;
  const withStops = (isJourney && chosenRoad.value === 0 && journey.value?.soc_needed_with_stops) || 2;
  const plan = chargingPlan.value;
  const isKnown = needed !== undefined || plan || isStuck.value;
  if (!isKnown || driving.value || mode.value !== "plan") return null;
  const isOld = isJourney ? answersAreOld.value : leavingIsOld.value;
  const { journey: words } = text.value;
  const stopsHelp = withStops <= 1 && withStops < (needed ?? 2);
  const leaves = needed !== undefined && !plan;
  const texts = [
    isStuck.value && isLow.value && ((needed ?? 2) > 1 || stopsHelp) && words.callHelp,
    leaves && (stopsHelp ? words.leaveWithout(upwards(needed)) : leaveText(needed, of)),
    isStuck.value && trip.value?.stops?.[0] && <NoStop of={trip.value} from={trip.value.stops[0]} />,
    needed !== undefined && !!speed && words.atMost(format.value.shown(speed, units.value.speed, 0)),
  ];
  const moreWh = (upwardsSoc(withStops) - (of.series.displayed_soc[0] as number)) * of.wh_per_display;
  const more = format.value.shown(moreWh, ENERGY, 1);
  const isLast = (plan?.p_arrive ?? 0) >= OPEN[1]; // who gets there anyway
  const helps = stopsHelp && <p>{words.leaveWithStops(upwards(withStops), more, isLast)}</p>;
  return (
    <div class={`journey-answer todo${isOld ? " old" : ""}`} aria-busy={isOld}>
      {!isLast && helps}
      {helps && !isLast && <h3>{words.otherwise}</h3>}
      <ul>
        {(plan || emptyAfterM(of) === null) && <Halts plan={plan} />}
        {texts.map((one, k) => one && <li key={k}>{one}</li>)}
      </ul>
      {isLast && helps}
      {plan && trip.value && !isLow.value && <ChargedFirst of={trip.value} plan={plan} needed={needed} />}
    </div>
  );
}

/** How sure the answer is in a line, with what it rests on behind it; what would change the answer stands above. */
function HowSure({ of, now }: { of: Forecast; now: Answer }) {
  const others = mode.value === "compare" ? (alternative.value?.flags ?? []) : [];
  const chance = decisiveChance(now);
  const isOpen = chance > OPEN[0] && chance < OPEN[1] && !stopInDoubt.value;
  const { verdict: words, result, ownCars: ownWords } = text.value;
  const untrue = [chargingPlan.value && EMPTY, isSlow.value && BEST_EFFORT];
  const flags = [...of.flags, ...(journey.value?.flags ?? [])].filter(({ code }) => !untrue.includes(code));
  const count = warningsOf(flags, wording.value).length;
  const planned = trip.value?.links ?? trip.value?.stops;
  const own = ownCars.value?.find(({ name }) => name === car.value?.own);
  return (
    <>
      {isOpen && <Warnings flags={flags} others={others} serious />}
      <details class="sure">
        <summary>
          <b>{words.sure}</b>
          {count > 0 && ` · ${words.reasons(count)}`}
        </summary>
        <p class="given">
          {planned ? result.givenPlanned : result.givenDriven} <Climb of={of} />{" "}
          {own && `${ownWords.learnedFrom(own.in_diary)}.`}
          {own && own.in_diary > 0 && !isBetter(own) && ` ${ownWords.noGain}`}
        </p>
        <Warnings flags={flags} others={others} serious={isOpen ? false : null} />
      </details>
    </>
  );
}

let farTexts: string[] = [];

/** Places that are far from their road; of before while an end is dragged, so that the map below stays where it is. */
function FarTexts() {
  const flags = (journey.value?.flags ?? []).filter(({ code }) => code === FAR);
  const now = roadPoints.value ? warningsOf(flags, wording.value).map((warning) => warning.text) : [];
  if (!trip.value?.isDraft) farTexts = now;
  return farTexts.map((one) => (
    <p key={one} class="off-road">
      {one}
    </p>
  ));
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
  const isSettled = !isOther && !isLate.value && !isLookingForStops.value;
  const toDo = shown && !isOther && !isLookingForStops.value && <ToDo of={of} />;
  // with so little, and where the way that is usual is wrong, what to do comes before the figures
  const stopsBefore = (chargingPlan.value?.stops.findIndex(({ pause_s }) => pause_s > 0) ?? 0) > 0;
  const actsFirst =
    reasonOfJourney() === BELOW || isSlow.value || stopsBefore || (isLow.value && verdict !== "good");
  const said = isDistance ? needSentence() : shown && !isCompared && !isOther ? sentence(now) : words.title;
  return (
    <section
      class={`card verdict${isLate.value || isOther || isLookingForStops.value ? " late" : ""}${isSettled && verdict ? ` verdict-${verdict}` : ""}`}
      aria-labelledby="verdict-title"
      aria-busy={isLate.value || (!shown && !isDistance)}
    >
      <FarTexts />
      <div class="heading">
        <h2 id="verdict-title">{isLate.value && !isOther ? words.calculating : said}</h2>
        {trip.value && <ShareTools />}
      </div>
      <Failure />
      {isOther && <p class="other">{words.otherPlaces(trip.value?.title ?? "")}</p>}
      {isDistance && <NeedAnswer />}
      {shown && isCompared && alternative.value && <CompareLine first={of} second={alternative.value} />}
      {actsFirst && toDo}
      {shown && !isCompared && !isLookingForStops.value && <Headline of={of} now={now} />}
      {!actsFirst && toDo}
      {shown && !isLookingForStops.value && <HowSure of={of} now={now} />}
      {shown && isLookingForStops.value && <Whole now={now} isEmpty />}
      {!shown && !isDistance && !problem.value && <Waiting />}
    </section>
  );
}
