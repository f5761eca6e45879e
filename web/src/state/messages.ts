/** Messages of the service in the language of the page. */

import { computed } from "@preact/signals";
import { Translator } from "../model/messages";
import { language, messages } from "./preferences";

const translator = computed(() => messages.value && new Translator(messages.value));

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
