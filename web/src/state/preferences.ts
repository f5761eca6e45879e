/** Preferences, stored in the browser. */

import { computed, effect, signal } from "@preact/signals";
import { formatFor } from "../model/format";
import { type System, systemOf, unitsOf } from "../model/units";
import { ENGLISH, type Language, languageOf, load, localeOf } from "../text";

const KEY = "tripwatt.preferences";

export type Theme = "system" | "light" | "dark";

interface Stored {
  system: System;
  theme: Theme;
  wholeBattery: boolean;
  /** Null for that of the browser. */
  language: Language | null;
}

/** Read the object stored under `key`; an empty object when there is none. */
export function readStored<T>(key: string): Partial<T> {
  try {
    return (JSON.parse(localStorage.getItem(key) ?? "{}") ?? {}) as Partial<T>;
  } catch {
    return {};
  }
}

/** Store `value` under `key`; ignored when the browser does not allow it. */
export function writeStored(key: string, value: unknown): void {
  try {
    localStorage.setItem(key, JSON.stringify(value));
  } catch {
    return;
  }
}

const stored = readStored<Stored>(KEY);

export const system = signal<System>(stored.system ?? systemOf(navigator.language));
export const theme = signal<Theme>(stored.theme ?? "system");
export const wholeBattery = signal(stored.wholeBattery ?? false);
/** Null for the language of the browser. */
export const chosenLanguage = signal<Language | null>(stored.language ?? null);
const askedLanguage = computed(() => languageOf(chosenLanguage.value, navigator.languages));
const catalogue = signal(ENGLISH);
/** The language that is shown. */
export const language = computed(() => catalogue.value.language);
export const text = computed(() => catalogue.value.text);
export const messages = computed(() => catalogue.value.messages);
export const format = computed(() => formatFor(localeOf(language.value, navigator.languages)));
export const units = computed(() => unitsOf(system.value));
export const wording = computed(() => ({ text: text.value, format: format.value, units: units.value }));

// eslint-disable-next-line page/text -- a media query
const prefersDark = matchMedia("(prefers-color-scheme: dark)");
const systemDark = signal(prefersDark.matches);
export const dark = computed(() => (theme.value === "system" ? systemDark.value : theme.value === "dark"));

/** Show the language that is asked for, from when it is loaded; done with the first one. What cannot be loaded changes nothing. */
export function keepLanguage(): Promise<void> {
  let isShown = Promise.resolve();
  effect(() => {
    const asked = askedLanguage.value;
    isShown = load(asked).then(
      (found) => {
        if (asked === askedLanguage.peek()) catalogue.value = found;
      },
      () => undefined,
    );
  });
  return isShown;
}

/** Apply the preferences to the document and store them whenever they change. */
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
    writeStored(KEY, {
      system: system.value,
      theme: theme.value,
      wholeBattery: wholeBattery.value,
      language: chosenLanguage.value,
    });
  });
}
