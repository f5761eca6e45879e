/** Phrases used in several parts of the page. */

import type { Forecast } from "../api/documents";
import { arrivalBand, hundredthsOf } from "../model/arrival";
import { daysBetween } from "../model/clock";
import { PERCENT } from "../model/units";
import { format, text, units } from "../state/preferences";
import type { Trip } from "../state/trip";

/** The central 90 % interval of the charge on arrival. */
export function bandText(of: Forecast, digits = 0): string {
  return bandOf(arrivalBand(of), digits);
}

/** An interval of the charge. */
export function bandOf(interval: readonly [number, number], digits = 0): string {
  const [low, high] = interval.map((soc) => format.value.figure(PERCENT.from(soc), digits)) as [
    string,
    string,
  ];
  const both = low === high ? low : text.value.result.range(low, high);
  return `${both}\u00a0${PERCENT.unit}`;
}

/** A probability, such as 97 in 100. */
export function chanceInFigures(chance: number): string {
  const { side, count } = hundredthsOf(chance);
  return text.value.chance.figures[side](count);
}

/** Temperatures from the lowest to the highest [°C]. */
export function temperaturesText([lowest, highest]: readonly [number, number]): string {
  const { from, unit, digits } = units.value.temperature;
  const [low, high] = [lowest, highest].map((degc) => format.value.figure(from(degc), digits)) as [
    string,
    string,
  ];
  return `${low === high ? low : text.value.result.range(low, high)}\u00a0${unit}`;
}

export function tripTitle(trip: Trip): string {
  if (trip.distance) {
    const { distanceM, kind } = trip.distance;
    const far = format.value.shown(distanceM, units.value.distance, 0);
    return `${far}, ${text.value.distanceForm.kinds[kind]}`;
  }
  return trip.title || text.value.trip.plannedRoute;
}

/** A clock time; with its day where that is not the day of `from`. */
export function clockText(time: Date, from: Date): string {
  const { locale } = format.value;
  const clock = new Intl.DateTimeFormat(locale, { hour: "numeric", minute: "2-digit" }).format(time);
  const days = daysBetween(from, time);
  if (days === 0) return clock;
  const day =
    days === 1 || days === -1
      ? new Intl.RelativeTimeFormat(locale, { numeric: "auto" }).format(days, "day")
      : new Intl.DateTimeFormat(locale, { weekday: "short", day: "numeric", month: "short" }).format(time);
  return `${day} ${clock}`;
}
