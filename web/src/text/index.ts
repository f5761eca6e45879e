/** The texts of the page in all languages. English is a part of the page; another language is loaded when it is chosen. */

import type { Messages } from "../model/messages";
import { en, type Text } from "./en";
import { pluralOf } from "./plural";

export type { Text };

/** Languages of the page with their names; the first is the default. */
export const LANGUAGES = { en: "English", de: "Deutsch" } as const;

export type Language = keyof typeof LANGUAGES;

export interface Catalogue {
  language: Language;
  text: Text;
  /** Its words for the messages of the service, which are in English. */
  messages: Messages | null;
}

export const ENGLISH: Catalogue = { language: "en", text: en, messages: null };

export async function load(language: Language): Promise<Catalogue> {
  if (language === "en") return ENGLISH;
  const [{ german }, { default: messages }] = await Promise.all([
    import("./de"),
    import("./messages-de.json"),
  ]);
  return { language, text: german(pluralOf(language)), messages };
}

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
