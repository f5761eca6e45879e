/** All text of the page, in each of its languages. */

import { de } from "./de";
import { en, type Text } from "./en";

export type { Text };

/** Languages of the page with their own names; the first is that of a browser that asks for none of them. */
export const LANGUAGES = { en: "English", de: "Deutsch" } as const;

export type Language = keyof typeof LANGUAGES;

export const CATALOGUES: Record<Language, Text> = { en, de };

function languageIn(tag: string): string {
  return tag.split("-", 1)[0]?.toLowerCase() ?? "";
}

function isLanguage(name: unknown): name is Language {
  return typeof name === "string" && name in LANGUAGES;
}

/** The language that was chosen, else the first of the browser's that the page has. */
export function languageOf(chosen: unknown, browser: readonly string[]): Language {
  if (isLanguage(chosen)) return chosen;
  return browser.map(languageIn).find(isLanguage) ?? "en";
}

/** The browser's own variant of a language, such as "de-CH", for its numbers. */
export function localeOf(language: Language, browser: readonly string[]): string {
  return browser.find((tag) => languageIn(tag) === language) ?? language;
}
