/** Cars for what is still being typed. */

import type { Vehicle } from "../api/documents";

/** The cars that were found, then those with a word that begins with each of the words. */
export function withBeginning(words: string, found: readonly Vehicle[], all: readonly Vehicle[]): Vehicle[] {
  const starts = words.toLowerCase().trim().split(/\s+/);
  const parts = ({ title, name }: Vehicle) => `${title} ${name}`.toLowerCase().split(/[\s_]+/);
  const fits = (row: Vehicle) => starts.every((one) => parts(row).some((part) => part.startsWith(one)));
  return [...found, ...all.filter((row) => fits(row) && !found.some(({ name }) => name === row.name))];
}
