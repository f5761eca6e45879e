/** Messages of the service in the language of the page. Their German is loaded when German is chosen. */

import { computed, effect, signal } from "@preact/signals";
import { Translator } from "../model/messages";
import { language } from "./preferences";

const german = signal<Translator | null>(null);
const translator = computed(() => (language.value === "de" ? german.value : null));

/** Load what the language of the page needs. */
export function keepMessages(): void {
  effect(() => {
    if (language.value !== "de" || german.peek()) return;
    void import("../text/messages-de.json").then(({ default: messages }) => {
      german.value = new Translator(messages);
    });
  });
}

export interface Said {
  text: string;
  /** Its language where it is not that of the page. */
  lang: "en" | undefined;
}

/** A message of the service; in English where its words are unknown. */
export function said(message: string): Said {
  const known = translator.value?.message(message) ?? null;
  if (known !== null) return { text: known, lang: undefined };
  return { text: message, lang: language.value === "en" ? undefined : "en" };
}

/** A place in an input. */
export function placeText(where: string): string {
  return translator.value?.place(where) ?? where;
}

/** A kind of place of OpenStreetMap; empty where the language has no word for it. */
export function osmKind(kind: string): string {
  return translator.value ? translator.value.kind(kind) : kind.replaceAll("_", " ");
}
