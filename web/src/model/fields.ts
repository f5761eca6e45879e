/** The fields of a departure, by what they hold. */

import { FIELDS } from "../../generated/fields";
import type { ForecastRequest } from "../../generated/types";

type Table = typeof FIELDS;
type Holding<Entry> = { [Name in FieldName]: Table[Name] extends Entry ? Name : never }[FieldName];

export type FieldName = keyof Table;
/** Value of a field that is known. */
export type Value<Name extends FieldName> = NonNullable<ForecastRequest[Name]>;

export type NumberName = Holding<{ unit: string }>;
export type SeveralName = Holding<{ several: true }>;
export type ChoiceName = Exclude<Holding<{ choices: readonly string[] }>, SeveralName>;

/** Fields that a form asks for; the start temperatures follow from where the car was before. */
export type AskedName = Exclude<FieldName, "cabin_temperature_degc" | "battery_temperature_degc">;

/** A text for each choice. */
export type ChoiceTexts = {
  [Name in ChoiceName | SeveralName]: Record<Table[Name]["choices"][number], string>;
};

const NAMES = Object.keys(FIELDS) as FieldName[];

export function isNumber(name: FieldName): name is NumberName {
  return "unit" in FIELDS[name];
}

export const NUMBERS = NAMES.filter(isNumber);
export const SEVERAL = NAMES.filter((name): name is SeveralName => "several" in FIELDS[name]);
export const CHOICES = NAMES.filter(
  (name): name is ChoiceName => !isNumber(name) && !("several" in FIELDS[name]),
);

/** The values of fields that an object of the service has, as far as they are of their kind. */
export function valuesIn(known: Record<string, unknown>): Partial<Record<FieldName, unknown>> {
  const kinds = { number: NUMBERS, string: CHOICES, object: SEVERAL };
  return Object.fromEntries(
    Object.entries(kinds).flatMap(([kind, names]) =>
      names
        .filter((name) => known[name] != null && typeof known[name] === kind)
        .map((name) => [name, known[name]]),
    ),
  );
}
