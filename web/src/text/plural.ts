/** Forms of a noun by its count. */

export interface Forms {
  one: string;
  other: string;
}

/** Picks the form for a count and puts the count in place of "#". */
export type Plural = (count: number, forms: Forms) => string;

export function pluralOf(language: string): Plural {
  const rules = new Intl.PluralRules(language);
  const numbers = new Intl.NumberFormat(language);
  return (count, forms) =>
    forms[rules.select(count) === "one" ? "one" : "other"].replace("#", numbers.format(count));
}
