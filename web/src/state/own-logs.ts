/** Logs that are given to a car: files are sent, read, left out or used again, and learned. */

import { computed, signal } from "@preact/signals";
import { learnLogs, readLogs, sendFile } from "../api/client";
import type {
  Fault,
  FileReading,
  KindChanges,
  KindReading,
  LogsReading,
  LogsRequest,
} from "../api/documents";
import { asked, faultsFrom, faultsOfCars, follow, keep } from "./own-cars";
import { text } from "./preferences";

const MOST_BYTES = 64_000_000;
const MEGABYTE = 1_000_000;
const AT_ONCE = 2;
/** Share of columns in common from which files are of one kind. */
const ALIKE = 0.7;

/** A file that was chosen and is not read yet, or was refused. */
interface Chosen {
  file: File;
  state: "waiting" | "sending" | "sent" | "out" | "ignored";
  faults: Fault[];
}

/** Files for a car that are not learned yet. */
interface Logs {
  car: string;
  upload: string;
  stage: "sending" | "reading" | "ready";
  request: Required<LogsRequest>;
  chosen: Chosen[];
  /** Null before the first reading. */
  read: LogsReading | null;
  /** Files by name as they were read when they were last used. */
  used: ReadonlyMap<string, FileReading>;
}

/** Kinds of rows, those to look at first; a file that is left out by the user stays where it was. */
export const GROUPS = ["out", "way", "part", "read"] as const;
export type Group = (typeof GROUPS)[number];

/** A file as it is listed. */
export interface LogFile {
  key: string;
  name: string;
  state: Chosen["state"] | "read" | "part";
  group: Group;
  rows: number;
  rows_used: number;
  faults: Fault[];
  /** Of a file that the service does not have. */
  chosen?: Chosen;
}

/** States of files as the service calls them, in a word. */
// eslint-disable-next-line page/text -- of the contract
const STATES = { read: "read", "in part": "part", "left out": "out", ignored: "ignored" } as const;

export const logs = signal<Logs | null>(null);

/** All files, in the order in which they are listed. */
export const logFiles = computed<LogFile[]>(() => {
  const now = logs.value;
  if (!now) return [];
  const ignored = new Set(now.request.ignored);
  const chosen = now.chosen.map((one, k): LogFile => {
    const isOut = one.state === "out" || one.state === "ignored";
    const group = isOut ? "out" : "way";
    const { name } = one.file;
    return { ...one, key: `${k} ${name}`, name, group, rows: 0, rows_used: 0, chosen: one };
  });
  const read = (now.read?.files ?? []).map((document): LogFile => {
    const known = now.used.get(document.name) ?? document;
    const group = known.state === "ignored" ? "read" : STATES[known.state];
    const state = ignored.has(known.name) ? "ignored" : STATES[known.state];
    return { ...known, key: `/${known.name}`, state, group };
  });
  return [...chosen, ...read];
});

/** Whether the logs are held back because their energy is not one that the car can take. */
export const isHeldBack = computed(
  // eslint-disable-next-line page/text -- of the contract
  () => logs.value?.read?.faults.some(({ what }) => what === "implausible energy") ?? false,
);

/** Files that are used as far as they go, and cannot be read. */
export const unreadable = computed(() => logFiles.value.filter(({ state }) => state === "out"));

/** Change what is given to the car, unless it was cancelled or another upload began. */
function change(upload: string, by: (now: Logs) => Partial<Logs>): void {
  const now = logs.value;
  if (now?.upload === upload) logs.value = { ...now, ...by(now) };
}

function uploadName(): string {
  return Array.from(crypto.getRandomValues(new Uint8Array(12)), (byte) => (byte % 36).toString(36)).join("");
}

function begun(car: string): Logs {
  const request = { kinds: {}, ignored: [], implausible: false };
  const upload = uploadName();
  return { car, upload, stage: "ready", request, chosen: [], read: null, used: new Map() };
}

/** A file before it is sent; one that is too large is not. */
function toSend(file: File): Chosen {
  if (file.size <= MOST_BYTES) return { file, state: "waiting", faults: [] };
  const what = text.value.trip.tooLarge(file.name, MOST_BYTES / MEGABYTE);
  return { file, state: "out", faults: [{ code: "too-large", what, where: "" }] };
}

/** Send files beside those that are there already, and read them. */
export async function sendFiles(car: string, files: readonly File[]): Promise<void> {
  faultsOfCars.value = [];
  const now = logs.value?.car === car ? logs.value : begun(car);
  logs.value = { ...now, chosen: [...now.chosen, ...files.map(toSend)] };
  await sendWaiting(now.upload);
}

async function sendWaiting(upload: string): Promise<void> {
  if (logs.value?.stage === "sending") return; // they are sent with the others
  change(upload, () => ({ stage: "sending" }));
  const mark = (file: File, state: Chosen["state"], faults: Fault[] = []) => {
    change(upload, ({ chosen }) => ({
      chosen: chosen.map((one) => (one.file === file ? { file, state, faults } : one)),
    }));
  };
  const next = () =>
    (logs.value?.upload === upload ? logs.value : null)?.chosen.find((f) => f.state === "waiting");
  const send = async (car: string) => {
    for (let one = next(); one; one = next()) {
      const { file } = one;
      mark(file, "sending");
      try {
        await sendFile(car, upload, file);
        mark(file, "sent");
      } catch (error) {
        mark(file, "out", faultsFrom(error));
      }
    }
  };
  const { car } = logs.value ?? { car: "" };
  await Promise.all(Array.from({ length: AT_ONCE }, () => send(car)));
  const now = logs.value?.upload === upload ? logs.value : null;
  if (!now) return;
  const isNew = now.chosen.some(({ state }) => state === "sent");
  if (isNew || now.read) await read(now, now.request, isNew);
  else change(upload, () => ({ stage: "ready" }));
}

/** Changes of kinds under the numbers that the same kinds have beside new files. */
function renumbered(
  changes: Record<string, KindChanges>,
  before: readonly KindReading[],
  after: readonly KindReading[],
): Record<string, KindChanges> {
  const moved: Record<string, KindChanges> = {};
  for (const { number, columns } of before) {
    const its = changes[`${number}`];
    const same = after.find((kind) => {
      const common = kind.columns.filter((column) => columns.includes(column)).length;
      return common >= ALIKE * (kind.columns.length + columns.length - common);
    });
    if (its && same) moved[`${same.number}`] = its;
  }
  return moved;
}

let turns = 0;

/** Read what was sent; only the last of several readings counts. */
async function read(before: Logs, wanted: Required<LogsRequest>, isNew = false): Promise<void> {
  const { car, upload } = before;
  const turn = ++turns;
  const sent = new Set(before.chosen.filter(({ state }) => state === "sent"));
  change(upload, () => ({ stage: "reading", request: wanted }));
  let request = wanted;
  if (isNew && before.read && Object.keys(wanted.kinds).length > 0) {
    const plain = await asked(() => readLogs(car, upload, { ...wanted, kinds: {} }));
    request = { ...wanted, kinds: renumbered(wanted.kinds, before.read.kinds, plain?.kinds ?? []) };
  }
  const found = await asked(() => readLogs(car, upload, request));
  if (turn !== turns) return;
  change(upload, ({ chosen, used, stage }) => {
    const next = stage === "sending" ? stage : "ready";
    if (!found) return { stage: next, request: before.request };
    return {
      stage: next,
      request,
      read: found,
      chosen: chosen.filter((one) => !sent.has(one)),
      used: new Map([
        ...used,
        ...found.files.filter(({ state }) => state !== "ignored").map((file) => [file.name, file] as const),
      ]),
    };
  });
}

/** Read files of one kind otherwise than proposed. */
export async function changeKind(number: number, more: KindChanges): Promise<void> {
  const now = logs.value;
  if (!now) return;
  const { kinds } = now.request;
  const own = kinds[`${number}`];
  const changes = { ...own?.changes, ...more.changes };
  await read(now, { ...now.request, kinds: { ...kinds, [`${number}`]: { ...own, ...more, changes } } });
}

/** Take logs that are held back as they are. */
export async function takeAnyway(): Promise<void> {
  if (logs.value) await read(logs.value, { ...logs.value.request, implausible: true });
}

/** Leave files out. */
export async function leaveOut(files: readonly LogFile[]): Promise<void> {
  const now = logs.value;
  if (!now) return;
  const unsent = new Set(files.map(({ chosen }) => chosen));
  change(now.upload, ({ chosen }) => ({
    chosen: chosen.map((one) => (unsent.has(one) ? { ...one, state: "ignored" } : one)),
  }));
  const names = files.filter(({ chosen }) => !chosen).map(({ name }) => name);
  const ignored = [...new Set([...now.request.ignored, ...names])];
  if (logs.value && names.length > 0) await read(logs.value, { ...now.request, ignored });
}

/** Use a file again that was left out; one that the service does not have is sent again. */
export async function useAgain({ name, chosen: unsent }: LogFile): Promise<void> {
  const now = logs.value;
  if (!now) return;
  if (unsent) {
    change(now.upload, ({ chosen }) => ({
      chosen: chosen.map((one) => (one === unsent ? toSend(one.file) : one)),
    }));
    await sendWaiting(now.upload);
  } else {
    await read(now, { ...now.request, ignored: now.request.ignored.filter((other) => other !== name) });
  }
}

/** Learn what was read, and show the progress until it is learned. */
export async function learn(): Promise<void> {
  const now = logs.value;
  if (!now) return;
  const own = await asked(() => learnLogs(now.car, now.upload, now.request));
  if (!own) return;
  logs.value = null;
  keep(own);
  await follow(now.car);
}
