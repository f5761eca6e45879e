/** Which place a text names. The service uses the same rule. */

import type { Place } from "../api/documents";

const WORDS = /[\p{L}\p{N}_]+/gu;
const SPELLINGS: Record<string, string> = { ä: "ae", ö: "oe", ü: "ue", ß: "ss", æ: "ae", ø: "oe", å: "aa" };

/** The words of a text without accents, and with the letters that stand for one. */
function spelled(words: string): string[][] {
  const lower = words.toLowerCase();
  const plain = lower.normalize("NFKD").replaceAll(/\p{M}/gu, "").replaceAll("ß", "ss");
  const typed = lower.replaceAll(/[äöüßæøå]/gu, (letter) => SPELLINGS[letter] ?? letter);
  return [plain.match(WORDS) ?? [], typed.match(WORDS) ?? []];
}

/** Whether a text is the whole name: all words of its first part, and none that the name lacks. */
export function isCalled(name: string, words: string): boolean {
  const [first = ""] = name.split(",");
  return spelled(words).some((typed) =>
    spelled(first).some((part) =>
      spelled(name).some(
        (whole) =>
          part.length > 0 && part.every((w) => typed.includes(w)) && typed.every((w) => whole.includes(w)),
      ),
    ),
  );
}

/** The one place of a name; null where none has it, or several of one kind. */
export function placeCalled(words: string, places: Place[]): Place | null {
  const [first, ...others] = places.filter(({ name }) => isCalled(name, words));
  if (!first || others.some(({ kind }) => kind === first.kind)) return null;
  return first;
}
