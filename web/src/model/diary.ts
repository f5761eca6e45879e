/** How good the forecasts of a car's trips were, and what makes their ranges wide. */

import type { DiaryEntry, OwnCar, OwnCarSummary } from "../api/documents";

/** Most trips of one figure, as the service has it for the last ones. */
const MOST = 20;
/** Fewest trips whose error says anything. */
const FEWEST = 3;

type Measured = Pick<DiaryEntry, "energy_wh" | "forecast_wh">;

/** Errors of the trips over their energy; null without energy. */
export function errorOf(rows: readonly Measured[]): number | null {
  const energy = rows.reduce((sum, row) => sum + Math.abs(row.energy_wh), 0);
  const error = rows.reduce((sum, row) => sum + Math.abs(row.forecast_wh - row.energy_wh), 0);
  return energy > 0 ? error / energy : null;
}

export interface Trend {
  /** Trips of each figure. */
  trips: number;
  latest: number | null;
  /** Of as many trips before; null where there are too few. */
  before: number | null;
  /** Running error, the oldest first. */
  course: number[];
}

/** The error of the last trips and its trend; `diary` has the newest trip first. */
export function trendOf(diary: readonly Measured[]): Trend {
  const half = Math.floor(diary.length / 2);
  const trips = Math.min(MOST, half >= FEWEST ? half : diary.length);
  const parts = Array.from({ length: Math.max(0, diary.length - trips + 1) }, (_, k) =>
    errorOf(diary.slice(k, k + trips)),
  );
  return {
    trips,
    latest: parts[0] ?? null,
    before: half >= FEWEST ? (parts[trips] ?? null) : null,
    course: parts.filter((part): part is number => part !== null).reverse(),
  };
}

/** What makes the ranges of the forecasts wider than they need to be: trips without heights, or without outside temperature, and few trips. */
export function reasonsOf(
  diary: readonly Pick<DiaryEntry, "has_heights" | "ambient_temperature_degc">[],
  learned: number,
) {
  return {
    flat: diary.filter((row) => row.has_heights === false).length,
    withoutAir: diary.filter((row) => row.ambient_temperature_degc === null).length,
    isYoung: learned < MOST,
  };
}

/** The outside temperatures at which a car learned anything; null where there are none. */
export function seenIn(learned: OwnCar["learned"]): [number, number] | null {
  const seen = Object.values(learned).flatMap(({ seen_degc }) => seen_degc ?? []);
  return seen.length > 0 ? [Math.min(...seen), Math.max(...seen)] : null;
}

/** Whether the last trips were forecast better with what the car had learned than without. */
export function isBetter({ latest, latest_by_book: book }: OwnCarSummary): boolean {
  return (latest.weighted_error ?? 1) < (book.weighted_error ?? 0);
}
