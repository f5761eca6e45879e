/** The texts of the page in all languages. */

import { de } from "./de";
import { en, type Text } from "./en";

export type { Text };

/** Languages of the page with their names; the first is the default. */
export const LANGUAGES = { en: "English", de: "Deutsch" } as const;

export type Language = keyof typeof LANGUAGES;

export const CATALOGUES: Record<Language, Text> = { en, de };

function languageIn(tag: string): string {
  return tag.split("-", 1)[0]?.toLowerCase() ?? "";
}

function isLanguage(name: unknown): name is Language {
  return typeof name === "string" && name in LANGUAGES;
}

/** The chosen language, else the first language of the browser that the page has. */
export function languageOf(chosen: unknown, browser: readonly string[]): Language {
  if (isLanguage(chosen)) return chosen;
  return browser.map(languageIn).find(isLanguage) ?? "en";
}

/** The regional variant of a language in the browser, such as "de-CH", for number formats. */
export function localeOf(language: Language, browser: readonly string[]): string {
  return browser.find((tag) => languageIn(tag) === language) ?? language;
}
