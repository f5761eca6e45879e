/** Local times as the page writes them, and clock times of a journey. */

const MINUTE_MS = 60_000;
const DAY_MS = 86_400_000;

/** Wait for a time, or until it is stopped. */
export function pause(ms: number, stop?: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    setTimeout(resolve, ms);
    stop?.addEventListener("abort", () => resolve());
  });
}

function two(number: number): string {
  return String(Math.floor(number)).padStart(2, "0");
}

/** A local time, such as "2026-01-12T07:30", with the offset of its day: "2026-01-12T07:30:00+01:00". */
export function withOffset(local: string): string {
  const offset = -new Date(local).getTimezoneOffset();
  const size = Math.abs(offset);
  return `${local}:00${offset < 0 ? "-" : "+"}${two(size / 60)}:${two(size % 60)}`;
}

/** The local time of a date, to the minute. */
export function localOf(date: Date): string {
  const day = `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())}`;
  return `${day}T${two(date.getHours())}:${two(date.getMinutes())}`;
}

/** The local time if it is one and not past; else null. */
export function notPast(local: unknown, now = new Date()): string | null {
  const time = typeof local === "string" ? new Date(local).getTime() : Number.NaN;
  return time > now.getTime() - MINUTE_MS ? (local as string) : null;
}

/** Days from the day of one date to that of another. */
export function daysBetween(from: Date, to: Date): number {
  const day = (date: Date) => Date.UTC(date.getFullYear(), date.getMonth(), date.getDate());
  return Math.round((day(to) - day(from)) / DAY_MS);
}
