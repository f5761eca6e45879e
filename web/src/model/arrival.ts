/** The charge at the end, from an answer of the service. */

import type { Answer } from "../api/types";
import { interpolate } from "./interpolate";

export const DOTS = 20;

/** Displayed charge for each watt-hour: the answer's charge is a straight line in its energy. */
export function socPerWh({ series }: Answer): number {
  const last = series.energy_wh.length - 1;
  const most = (series.energy_high_wh[last] as number) - (series.energy_low_wh[last] as number);
  const span = (series.displayed_soc_high[last] as number) - (series.displayed_soc_low[last] as number);
  if (most > 0) return span / most;
  const soc = (series.displayed_soc[0] as number) - (series.displayed_soc[last] as number);
  return soc / ((series.energy_wh[last] as number) - (series.energy_wh[0] as number));
}

export function socFromEnergy(answer: Answer, energyWh: number): number {
  return answer.soc_arrival - (energyWh - answer.energy_wh) * socPerWh(answer);
}

/** Central 90 % of the charge at the end. */
export function arrivalBand({ series }: Answer): [number, number] {
  return [series.displayed_soc_low.at(-1) as number, series.displayed_soc_high.at(-1) as number];
}

/** Half-width of the central 50 % over that of the central 90 %. */
export function innerShare({ quantiles_wh: q, energy_wh }: Answer): number {
  const outer = (q["0.95"] as number) - energy_wh;
  return outer > 0 ? ((q["0.75"] as number) - energy_wh) / outer : 0;
}

/** Charges at the end that are equally likely: each stands for one trip in `DOTS`. */
export function equallyLikely(answer: Answer): number[] {
  const rows = Object.entries(answer.quantiles_wh)
    .map(([p, energy]) => [Number(p), energy] as const)
    .sort((a, b) => a[0] - b[0]);
  const ps = rows.map(([p]) => p);
  const energies = rows.map(([, energy]) => energy);
  return Array.from({ length: DOTS }, (_, k) =>
    socFromEnergy(answer, interpolate(1 - (k + 0.5) / DOTS, ps, energies)),
  );
}

/** Probability to arrive with the reserve, as the service computed it; null where it did not. */
export function chanceOf(answer: Answer, reserve: number): number | null {
  const found = Object.entries(answer.p_arrive).find(([level]) => Math.abs(Number(level) - reserve) < 1e-9);
  return found ? found[1] : null;
}

export type Verdict = "good" | "open" | "bad";

export function verdictOf(chance: number): Verdict {
  if (chance >= 0.95) return "good";
  return chance >= 0.5 ? "open" : "bad";
}

export type Likelihood =
  "almostCertain" | "veryLikely" | "likely" | "open" | "unlikely" | "veryUnlikely" | "almostImpossible";

const LEAST_CHANCES: [number, Likelihood][] = [
  [0.99, "almostCertain"],
  [0.9, "veryLikely"],
  [0.66, "likely"],
  [0.34, "open"],
  [0.1, "unlikely"],
  [0.01, "veryUnlikely"],
  [0, "almostImpossible"],
];

/** The word for a probability. */
export function likelihoodOf(chance: number): Likelihood {
  return (LEAST_CHANCES.find(([least]) => chance >= least) as [number, Likelihood])[1];
}

/** A probability in hundredths; beyond 1 and 99 only on which side it lies: none is called certain. */
export function hundredthsOf(chance: number): { side: "above" | "below" | "near"; count: number } {
  if (chance > 0.99) return { side: "above", count: 99 };
  if (chance < 0.01) return { side: "below", count: 1 };
  return { side: "near", count: Math.round(chance * 100) };
}

/** Distance at which the middle of the forecast reaches an empty battery; null when it lasts. */
export function emptyAfterM({ series }: Answer): number | null {
  const k = series.displayed_soc.findIndex((soc) => soc <= 0);
  if (k < 0) return null;
  if (k === 0) return 0;
  const above = series.displayed_soc[k - 1] as number;
  const share = above / (above - (series.displayed_soc[k] as number));
  const start = series.distance_m[k - 1] as number;
  return start + share * ((series.distance_m[k] as number) - start);
}
