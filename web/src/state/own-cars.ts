/** Cars that the service keeps: their logs, what they learn from them, and their diaries. */

import { batch, computed, signal } from "@preact/signals";
import {
  createCar,
  forgetCar,
  getCar,
  learnLogs,
  listCars,
  newCarToken,
  readLogs,
  RequestFailed,
  sendFile,
} from "../api/client";
import type { Fault, LogsChanges, LogsReading, NewCarRequest, OwnCar, OwnCarSummary } from "../api/documents";
import { car, type Car, chooseOwn, DESCRIBED, vehicle } from "./car";

/** Time between two looks at a car that learns [ms]. */
const LOOK_AGAIN_MS = 700;

/** Null where the service keeps no cars. */
export const ownCars = signal<OwnCarSummary[] | null>(null);
/** The car that is shown, with its diary. */
export const shownCar = signal<OwnCar | null>(null);
/** Logs that were sent and are not learned yet. */
export const reading = signal<{ upload: string; changes: LogsChanges; logs: LogsReading } | null>(null);
/** A file that is on its way, or whose columns are being read. */
export const sending = signal<string | null>(null);
export const faultsOfCars = signal<Fault[]>([]);

/** Whether the shown car learns at this moment. */
export const learns = computed(() => shownCar.value?.learning?.state === "running");

function faultsFrom(error: unknown): Fault[] {
  if (!(error instanceof RequestFailed)) throw error;
  const { problem } = error;
  const { faults, title, detail } = problem;
  if (faults?.length) return faults;
  return [{ what: title || detail || problem.type, where: "" }];
}

/** Run a request; faults of an earlier one go, its own are shown. */
async function asked<T>(request: () => Promise<T>): Promise<T | null> {
  faultsOfCars.value = [];
  try {
    return await request();
  } catch (error) {
    faultsOfCars.value = faultsFrom(error);
    return null;
  }
}

/** Load the cars, if the service keeps any. */
export async function loadOwnCars(): Promise<void> {
  ownCars.value = await listCars();
}

function keep(own: OwnCar): void {
  batch(() => {
    shownCar.value = own;
    const others = (ownCars.value ?? []).filter(({ name }) => name !== own.name);
    ownCars.value = [...others, own].sort((a, b) => a.name.localeCompare(b.name));
  });
}

/** The chosen car of the page as that of a new one. */
function kind(chosen: Car | null): Omit<NewCarRequest, "name"> {
  if (chosen?.figures) return { vehicle_figures: chosen.figures };
  return { vehicle: chosen?.vehicle === DESCRIBED ? null : (vehicle.value?.name ?? chosen?.vehicle ?? null) };
}

export async function addCar(name: string): Promise<void> {
  const made = await asked(() => createCar({ name, ...kind(car.value) }));
  if (made) keep(made);
}

export async function showCar(name: string): Promise<void> {
  reading.value = null;
  const own = await asked(() => getCar(name));
  if (!own) return;
  keep(own);
  if (own.learning?.state === "running") void follow(name);
}

export async function dropCar(name: string): Promise<void> {
  if (!(await asked(() => forgetCar(name)))) return;
  batch(() => {
    ownCars.value = (ownCars.value ?? []).filter((row) => row.name !== name);
    shownCar.value = null;
    reading.value = null;
    if (car.value?.own === name && vehicle.value) car.value = { ...car.value, own: "" };
  });
}

export const tokenOf = (name: string) => asked(() => newCarToken(name));

/** Use the shown car for the forecasts of the page. */
export function useCar({ name, vehicle: of, title }: OwnCarSummary): void {
  chooseOwn(name, of, title);
}

function uploadName(): string {
  return Array.from(crypto.getRandomValues(new Uint8Array(12)), (byte) => (byte % 36).toString(36)).join("");
}

/** Send files, and show how they are read; files that are sent before the last ones are learned come beside them. */
export async function sendFiles(name: string, files: readonly File[]): Promise<void> {
  const upload = reading.value?.upload ?? uploadName();
  const changes = reading.value?.changes ?? {};
  const faults: Fault[] = [];
  let sent = reading.value !== null;
  for (const file of files) {
    sending.value = file.name;
    const done = await asked(() => sendFile(name, upload, file));
    faults.push(...faultsOfCars.value);
    sent ||= done !== null;
  }
  if (sent) await read(name, upload, changes);
  sending.value = null;
  faultsOfCars.value = [...faults, ...faultsOfCars.value];
}

async function read(name: string, upload: string, changes: LogsChanges): Promise<void> {
  const logs = await asked(() => readLogs(name, upload, changes));
  if (logs) reading.value = { upload, changes, logs };
}

/** Read the sent logs again with changed columns. */
export async function changeReading(name: string, more: LogsChanges): Promise<void> {
  const now = reading.value;
  if (!now) return;
  const { changes: columns, ...rest } = more;
  await read(name, now.upload, {
    ...now.changes,
    ...rest,
    changes: { ...now.changes.changes, ...columns },
  });
}

/** Learn the sent logs, and show the progress until they are learned. */
export async function learn(name: string): Promise<void> {
  const now = reading.value;
  if (!now) return;
  const own = await asked(() => learnLogs(name, now.upload, now.changes));
  if (!own) return;
  reading.value = null;
  keep(own);
  await follow(name);
}

async function follow(name: string): Promise<void> {
  while (shownCar.value?.name === name && learns.value) {
    await new Promise((resolve) => setTimeout(resolve, LOOK_AGAIN_MS));
    const own = await asked(() => getCar(name));
    if (!own) return;
    if (shownCar.value?.name === name) keep(own);
  }
  // forecasts of the page by this car are those of what it has learned
  if (car.value?.own === name) car.value = { ...car.value };
}
