/** Messages of the service in another language: by templates with {} for their values. */

export interface Messages {
  templates: Readonly<Record<string, string>>;
  places: Readonly<Record<string, string>>;
  kinds: Readonly<Record<string, string>>;
  decimal: string;
}

interface Pattern {
  matches: RegExp;
  words: string;
  /** Characters that are no values. */
  letters: number;
  isOfParts: boolean;
}

const DEEPEST = 4;
/** Between the messages of one text. */
const BORDER = "; ";
const NUMBER = /^-?\d+\.\d+$/;
const HOLES = /\{(\d*)\}/g;

function escaped(text: string): string {
  return text.replaceAll(/[$()*+.?[\\\]^{|}]/g, String.raw`\$&`);
}

function patternOf([template, words]: readonly [string, string]): Pattern {
  const parts = template.split("{}");
  const matches = new RegExp(`^${parts.map(escaped).join("(.*?)")}$`, "su");
  return { matches, words, letters: parts.join("").length, isOfParts: template.includes(BORDER) };
}

/** Words of a text that stand alone: not parts of a name, a path or a number. */
function alone(word: string): RegExp {
  const other = String.raw`[\p{L}\p{N}_.'"/\-]`;
  return new RegExp(`(?<!${other})${escaped(word)}(?!${other})`, "gu");
}

export class Translator {
  private readonly patterns: readonly Pattern[];
  private readonly places: readonly (readonly [RegExp, string])[];

  constructor(private readonly messages: Messages) {
    this.patterns = Object.entries(messages.templates)
      .filter(([template]) => template.includes("{}"))
      .map(patternOf)
      .sort((one, other) => other.letters - one.letters);
    this.places = Object.keys(messages.places)
      .sort((one, other) => other.length - one.length)
      .map((word) => [alone(word), messages.places[word] ?? word] as const);
  }

  /** The message in the language; null for one that is unknown. */
  message(text: string): string | null {
    return this.known(text, 0);
  }

  /** A place in an input, such as "links, row 3". */
  place(where: string): string {
    let put = where;
    for (const [word, words] of this.places) put = put.replaceAll(word, words);
    return put;
  }

  /** A kind of place of OpenStreetMap; empty for an unknown one. */
  kind(kind: string): string {
    return this.messages.kinds[kind.replaceAll("_", " ")] ?? "";
  }

  private known(text: string, depth: number): string | null {
    const whole = this.messages.templates[text];
    if (whole != null) return whole;
    if (depth > DEEPEST) return null;
    if (text.includes(BORDER)) {
      const whole = this.matched(text, depth, (pattern) => pattern.isOfParts);
      return whole ?? this.parted(text, BORDER, depth);
    }
    return this.matched(text, depth, () => true) ?? this.parted(text, ": ", depth);
  }

  private matched(text: string, depth: number, isAsked: (pattern: Pattern) => boolean): string | null {
    for (const pattern of this.patterns.filter(isAsked)) {
      const values = pattern.matches.exec(text)?.slice(1);
      if (values) return this.filled(pattern.words, values, depth);
    }
    return null;
  }

  /** A text of several messages; null where none is known. */
  private parted(text: string, border: string, depth: number): string | null {
    const parts = text.split(border);
    if (parts.length < 2) return null;
    const known = parts.map((part) => this.known(part, depth + 1));
    if (known.every((part) => part === null)) return null;
    return known.map((part, k) => part ?? this.place(parts[k] ?? "")).join(border);
  }

  private filled(words: string, values: string[], depth: number): string {
    let next = 0;
    return words.replaceAll(HOLES, (_all, place: string) => {
      next += 1;
      return this.value(values[(place ? Number(place) : next) - 1] ?? "", depth + 1);
    });
  }

  /** A value of a message: a number, a name, or a message of its own. */
  private value(text: string, depth: number): string {
    if (NUMBER.test(text)) return text.replace(".", this.messages.decimal);
    const { kinds } = this.messages;
    return this.known(text, depth) ?? kinds[text] ?? text;
  }
}
