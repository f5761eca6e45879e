/** Server-sent events out of a stream of text. */

/** Longest event; those of the service have a few kilobytes. */
const MAX_CHARACTERS = 1_000_000;

export class EventParser {
  private rest = "";

  /** Data of the events that end in the next part of a stream; comments and other fields are left out. */
  take(part: string): string[] {
    const parts = (this.rest + part).split(/\r?\n\r?\n/);
    this.rest = parts.pop() ?? "";
    if (this.rest.length > MAX_CHARACTERS) throw new RangeError();
    return parts.map(dataOf).filter((data) => data !== "");
  }
}

function dataOf(event: string): string {
  return event
    .split(/\r?\n/)
    .filter((line) => line.startsWith("data:"))
    .map((line) => line.slice("data:".length).replace(/^ /, ""))
    .join("\n");
}
