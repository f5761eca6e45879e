/** Preferences, kept in this browser only. */

import { computed, effect, signal } from "@preact/signals";
import { formatOf } from "../model/format";
import { type System, unitsOf } from "../model/units";
import { CATALOGUES, type Language, languageOf, localeOf } from "../text";

const KEY = "tripwatt.preferences";

export type Theme = "system" | "light" | "dark";

interface Stored {
  system: System;
  theme: Theme;
  wholeBattery: boolean;
  /** Null for that of the browser. */
  language: Language | null;
}

/** What was stored under `key`, or nothing when it was not or cannot be read. */
export function recall<T>(key: string): Partial<T> {
  try {
    return (JSON.parse(localStorage.getItem(key) ?? "{}") ?? {}) as Partial<T>;
  } catch {
    return {};
  }
}

/** Store `value`; a browser that refuses to remember is no failure. */
export function remember(key: string, value: unknown): void {
  try {
    localStorage.setItem(key, JSON.stringify(value));
  } catch {
    return;
  }
}

const stored = recall<Stored>(KEY);
const usesMiles = /-(US|GB|LR|MM)$/.test(navigator.language);

export const system = signal<System>(stored.system ?? (usesMiles ? "imperial" : "metric"));
export const theme = signal<Theme>(stored.theme ?? "system");
export const wholeBattery = signal(stored.wholeBattery ?? false);
/** The language that was chosen; null for that of the browser. */
export const chosenLanguage = signal<Language | null>(stored.language ?? null);
export const language = computed(() => languageOf(chosenLanguage.value, navigator.languages));
export const text = computed(() => CATALOGUES[language.value]);
export const format = computed(() => formatOf(localeOf(language.value, navigator.languages)));
export const units = computed(() => unitsOf(system.value));

// eslint-disable-next-line page/text -- a media query
const prefersDark = matchMedia("(prefers-color-scheme: dark)");
const systemDark = signal(prefersDark.matches);
export const dark = computed(() => (theme.value === "system" ? systemDark.value : theme.value === "dark"));

/** Keep the document and the storage in step with the preferences. */
export function keepPreferences(): void {
  prefersDark.addEventListener("change", (event) => {
    systemDark.value = event.matches;
  });
  effect(() => {
    document.documentElement.dataset.theme = dark.value ? "dark" : "light";
  });
  effect(() => {
    document.documentElement.lang = language.value;
    document.title = text.value.document.title;
    document
      .querySelector("meta[name=description]")
      ?.setAttribute("content", text.value.document.description);
  });
  effect(() => {
    remember(KEY, {
      system: system.value,
      theme: theme.value,
      wholeBattery: wholeBattery.value,
      language: chosenLanguage.value,
    });
  });
}
