/** Numbers, durations and lists in the format of a locale. */

import type { Quantity } from "./units";

const NO_BREAK = "\u00a0";
const MIN_S_IN_MINUTES = 90;

function trueMinus(text: string): string {
  return text.replace("-", "−");
}

export type Format = ReturnType<typeof formatFor>;

/** Formatters of a locale; each is created when it is first used. */
export function formatFor(locale: string) {
  const formatters = new Map<string, Intl.NumberFormat>();
  const number = (minDigits: number, maxDigits: number, signDisplay: "negative" | "exceptZero") => {
    const key = `${minDigits} ${maxDigits} ${signDisplay}`;
    const known = formatters.get(key);
    if (known) return known;
    const next = new Intl.NumberFormat(locale, {
      minimumFractionDigits: minDigits,
      maximumFractionDigits: maxDigits,
      signDisplay,
    });
    formatters.set(key, next);
    return next;
  };
  const lists = new Intl.ListFormat(locale, { type: "conjunction" });
  const figure = (value: number, digits: number) =>
    trueMinus(number(digits, digits, "negative").format(value));
  const duration = (seconds: number) => {
    const minutes = Math.round(seconds / 60);
    if (minutes < 60) return `${figure(minutes, 0)}${NO_BREAK}min`;
    const rest = String(minutes % 60).padStart(2, "0");
    const hours = `${figure(Math.floor(minutes / 60), 0)}${NO_BREAK}h`;
    return minutes % 60 === 0 ? hours : [hours, rest, "min"].join(NO_BREAK);
  };
  return {
    locale,
    /** The number alone. */
    figure,
    /** The number without trailing zeros. */
    plain: (value: number, digits: number) => trueMinus(number(0, digits, "negative").format(value)),
    /** A difference, always with its sign. */
    signed: (value: number, digits: number) => trueMinus(number(digits, digits, "exceptZero").format(value)),
    /** Number and unit; the space between them does not break. */
    shown: (si: number, quantity: Quantity, digits = quantity.digits) =>
      `${figure(quantity.from(si), digits)}${NO_BREAK}${quantity.unit}`,
    /** Hours and minutes. */
    duration,
    /** Seconds below a minute and a half, else hours and minutes. */
    span: (seconds: number) =>
      seconds < MIN_S_IN_MINUTES
        ? `${figure(Math.max(Math.round(seconds), 1), 0)}${NO_BREAK}s`
        : duration(seconds),
    /** "a, b and c". */
    list: (parts: string[]) => lists.format(parts),
  };
}
