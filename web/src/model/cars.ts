/** Cars for what is still being typed. */

import type { Vehicle } from "../api/documents";

/** Cars with a word that begins with each of the words. */
export function beginning(words: string, vehicles: readonly Vehicle[]): Vehicle[] {
  const starts = words.toLowerCase().trim().split(/\s+/);
  const parts = ({ title, name }: Vehicle) => `${title} ${name}`.toLowerCase().split(/[\s_]+/);
  return vehicles.filter((row) => starts.every((one) => parts(row).some((part) => part.startsWith(one))));
}
