/** Battery charge on arrival, from a forecast of the service. */

import type { Forecast } from "../api/documents";
import { interpolate } from "./interpolate";

export const DOTS = 20;

/** Displayed charge on arrival of a trip that takes so much energy, between 0 and 1. */
export function socFromEnergy({ series, wh_per_display }: Forecast, energyWh: number): number {
  const left = (series.displayed_soc[0] as number) - energyWh / wh_per_display;
  return Math.min(Math.max(left, 0), 1);
}

/** Central 90 % interval of the charge on arrival. */
export function arrivalBand({ series }: Forecast): [number, number] {
  return [series.displayed_soc_low.at(-1) as number, series.displayed_soc_high.at(-1) as number];
}

/** Ratio of the half-widths of the central 50 % and the central 90 % interval. */
export function innerShare({ quantiles_wh: q, energy_wh }: Forecast): number {
  const outer = (q["0.95"] as number) - energy_wh;
  return outer > 0 ? ((q["0.75"] as number) - energy_wh) / outer : 0;
}

/** `DOTS` equally likely values of the charge on arrival. */
export function equallyLikely(forecast: Forecast): number[] {
  const rows = Object.entries(forecast.soc_quantiles)
    .map(([p, soc]) => [Number(p), soc] as const)
    .sort((a, b) => a[0] - b[0]);
  const ps = rows.map(([p]) => p);
  const socs = rows.map(([, soc]) => soc);
  return Array.from({ length: DOTS }, (_, k) => interpolate((k + 0.5) / DOTS, ps, socs));
}

/** The value at a charge that the service computed; null when there is none for it. */
function valueAt<T>(bySoc: Record<string, T>, soc: number): T | null {
  const level = Object.keys(bySoc).find((name) => Math.abs(Number(name) - soc) < 1e-9);
  return level === undefined ? null : (bySoc[level] as T);
}

/** Probability to arrive with the reserve, as computed by the service; null when the forecast has none for it. */
export function chanceOf(forecast: Forecast, reserve: number): number | null {
  return valueAt(forecast.p_arrive_by_soc, reserve);
}

export type Verdict = "good" | "open" | "bad";

/** Climb of an unknown road with which the expected charge on arrival falls to the reserve [m]; null where none does. */
export function climbToReserveM({ climb }: Forecast, reserve: number): number | null {
  return valueAt(climb?.changes_at_m ?? {}, reserve);
}

export function verdictOf(chance: number): Verdict {
  if (chance >= 0.95) return "good";
  return chance >= 0.5 ? "open" : "bad";
}

export type Likelihood =
  "almostCertain" | "veryLikely" | "likely" | "open" | "unlikely" | "veryUnlikely" | "almostImpossible";

const LIKELIHOODS: [number, Likelihood][] = [
  [0.99, "almostCertain"],
  [0.9, "veryLikely"],
  [0.66, "likely"],
  [0.34, "open"],
  [0.1, "unlikely"],
  [0.01, "veryUnlikely"],
  [0, "almostImpossible"],
];

/** The class of a probability; each has a text. */
export function likelihoodOf(chance: number): Likelihood {
  return (LIKELIHOODS.find(([lowest]) => chance >= lowest) as [number, Likelihood])[1];
}

/** A probability in hundredths; below 1 and above 99 only the side, so that nothing is shown as certain. */
export function hundredthsOf(chance: number): { side: "above" | "below" | "near"; count: number } {
  if (chance > 0.99) return { side: "above", count: 99 };
  if (chance < 0.01) return { side: "below", count: 1 };
  return { side: "near", count: Math.round(chance * 100) };
}

/** Probability to arrive before the battery is empty. */
export function chanceAtAll(forecast: Forecast): number {
  return forecast.p_arrive_by_soc["0"] as number;
}

/** Distance at which the battery is empty by the median forecast [m]; null when it is not. */
export function emptyAfterM(forecast: Forecast): number | null {
  return forecast.empty_at_m.expected;
}
