/** Phrases used in several parts of the page. */

import type { Station, Stop } from "../api/documents";
import { hundredthsOf } from "../model/arrival";
import { daysBetween } from "../model/clock";
import { HOURS, PERCENT, POWER, type Quantity } from "../model/units";
import { format, text, units } from "../state/preferences";
import { clock, type Turn } from "../state/answer";
import { journey } from "../state/journey";
import type { Trip } from "../state/trip";

/** A smaller charge is 0 % as it is shown. */
export const SHOWN_SOC = 0.005;

/** A smaller difference in height explains little of a charge [m]. */
const TOLD_RISE_M = 100;

/** From the first to the second of two values in SI, without their unit; one figure where both are the same. */
export function range(ends: readonly number[], quantity: Quantity, digits = quantity.digits): string {
  const [low = "", high = low] = ends.map((si) => format.value.figure(quantity.from(si), digits));
  return low === high ? low : text.value.result.range(low, high);
}

/** And with their unit. */
export function rangeWithUnit(ends: readonly number[], quantity: Quantity, digits?: number): string {
  return `${range(ends, quantity, digits)}\u00a0${quantity.unit}`;
}

/** The ends of the central 90 % interval, of quantiles by their probabilities. */
export function endsOf(quantiles: Record<string, number>): number[] {
  return ["0.05", "0.95"].map((p) => quantiles[p] ?? 0);
}

/** A charge, rounded up to whole percent. */
export function upwardsSoc(soc: number): number {
  return Math.ceil(soc * 100 - 1e-6) / 100;
}

export function upwards(soc: number): string {
  return format.value.shown(upwardsSoc(soc), PERCENT);
}

/** A probability, such as 97 in 100. */
export function chanceInFigures(chance: number): string {
  const { side, count } = hundredthsOf(chance);
  return text.value.chance.figures[side](count);
}

export function tripTitle(trip: Trip): string {
  if (trip.distance) {
    const { distanceM, kind } = trip.distance;
    const far = format.value.shown(distanceM, units.value.distance, 0);
    return `${far}, ${text.value.distanceForm.kinds[kind]}`;
  }
  return trip.title || text.value.trip.plannedRoute;
}

export function stationName({ name }: Station): string {
  return name || text.value.journey.unnamedStation;
}

/** Plug and power of a charging station, as far as they are known. */
export function chargerParts({ plug, power_w, power_known }: Station): string[] {
  const names: Record<string, string> = text.value.journey.plugs;
  const assumed = power_known ? "" : ` (${text.value.map.assumed})`;
  return [names[plug] ?? "", power_w > 0 ? format.value.shown(power_w, POWER) + assumed : ""].filter(Boolean);
}

/** A 90 % interval of a charge; only its upper end where the battery may be empty before, and nothing where it is. */
export function bandText([low = 0, high = low]: readonly number[]): string {
  if (high < SHOWN_SOC) return "";
  if (low < SHOWN_SOC) return text.value.result.atBest(format.value.shown(high, PERCENT));
  return rangeWithUnit([low, high], PERCENT);
}

/** Whether a car charges at a stop however it arrives there. */
export function isNeeded({ needed_below: least, pause_s, soc_arrival, soc_interval }: Stop): boolean {
  return pause_s > 0 || least <= soc_arrival || least > (soc_interval[1] ?? 1);
}

/** How long a car charges at a stop, and with which mean power; `explains` says why that is far below the station's. */
export function chargingText({ charging_s, energy_wh, station }: Stop, explains = false): string {
  const meanW = energy_wh / HOURS.from(charging_s);
  const power = format.value.shown(meanW, POWER);
  const { withPower, noMore } = text.value.journey;
  const codes = journey.value?.flags.map(({ code }) => code) ?? [];
  const isCold = station.direct_current && codes.includes("cold_charging_assumed");
  const reason = explains && meanW < 0.8 * station.power_w ? noMore(isCold) : "";
  return withPower(format.value.span(charging_s), power, reason);
}

/** The charge that a stop in a pause has to give, and how long that takes with a constant power. */
export function leastText({ charging_s, needed_below: least, soc_arrival, soc_leave }: Stop): string {
  const afterS = (charging_s * (least - soc_arrival)) / (soc_leave - soc_arrival);
  return text.value.journey.atLeast(upwards(least), afterS > 0 ? format.value.span(afterS) : "");
}

/** A clock time, and its day where that is not the day of `from`. */
export function clockParts(time: Date, from: Date): [string, string] {
  const { locale } = format.value;
  const clock = new Intl.DateTimeFormat(locale, { hour: "numeric", minute: "2-digit" }).format(time);
  const days = daysBetween(from, time);
  if (days === 0) return [clock, ""];
  const day =
    days === 1 || days === -1
      ? new Intl.RelativeTimeFormat(locale, { numeric: "auto" }).format(days, "day")
      : new Intl.DateTimeFormat(locale, { weekday: "short", day: "numeric", month: "short" }).format(time);
  return [clock, day];
}

/** Clock time and day, so long after the departure of the journey that is shown. */
export function clockAfter(s: number): [string, string] {
  const leaves = clock.value?.leaves ?? new Date();
  return clockParts(new Date(leaves.getTime() + s * 1000), leaves);
}

/** A height above a place or below it; nothing where it explains little. */
export function riseText(riseM: number): string {
  const height = format.value.shown(Math.abs(riseM), units.value.height);
  return Math.abs(riseM) < TOLD_RISE_M ? "" : text.value.journey.rise(height, riseM > 0);
}

/** Arrival at the turn of a journey, with its pause. */
export function turnText({ name, soc, atS, pauseS, riseM }: Turn): string {
  const { journey: words } = text.value;
  const { shown, span } = format.value;
  const arrival = words.turn(name, riseText(riseM), shown(soc, PERCENT), ...clockAfter(atS));
  return pauseS ? `${arrival} ${words.pauseAt(span(pauseS), ...clockAfter(atS + pauseS))}` : arrival;
}

/** Both in a line. */
export function clockText(time: Date, from: Date): string {
  const [clock, day] = clockParts(time, from);
  return day ? `${day} ${clock}` : clock;
}
