/** Cars that the service keeps: their logs, what they learn from them, and their diaries. */

import { batch, computed, signal } from "@preact/signals";
import { createCar, forgetCar, getCar, listCars, newCarToken, RequestFailed } from "../api/client";
import type { Fault, OwnCar, OwnCarSummary } from "../api/documents";
import { pause } from "../model/clock";
import { car, DESCRIBED, vehicle } from "./car";

/** Time between two looks at a car that learns [ms]. */
const LOOK_AGAIN_MS = 700;

/** Null where the service keeps no cars. */
export const ownCars = signal<OwnCarSummary[] | null>(null);

/** Names of cars that cannot be read, and why. */
export const damagedCars = signal<Record<string, Fault[]>>({});
/** The car that is shown, with its diary. */
export const shownCar = signal<OwnCar | null>(null);
export const faultsOfCars = signal<Fault[]>([]);

/** Whether the dialog of the cars is open. */
export const isOpen = signal(false);

/** Open the dialog, with the car of a name; without one, with that of the page. */
export function openOwnCars(name = car.value?.own): void {
  isOpen.value = true;
  const [only, ...others] = [...(ownCars.value ?? []), ...Object.keys(damagedCars.value)];
  const wanted = name || (typeof only === "object" && others.length === 0 ? only.name : "");
  if (wanted) void showCar(wanted);
}

/** Whether the shown car learns at this moment. */
export const learns = computed(() => shownCar.value?.learning?.state === "running");

/** What a request was refused for. */
export function faultsFrom(error: unknown): Fault[] {
  if (!(error instanceof RequestFailed)) throw error;
  const { problem } = error;
  const { faults, title, detail } = problem;
  if (faults?.length) return faults;
  return [{ code: problem.type, what: title || detail || problem.type, where: "" }];
}

/** Run a request; faults of an earlier one go, its own are shown. */
export async function asked<T>(request: () => Promise<T>): Promise<T | null> {
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
  const { cars, damaged } = await listCars();
  batch(() => {
    ownCars.value = cars;
    damagedCars.value = damaged;
  });
}

/** What the owner of a car calls it. */
export function labelOf(name: string): string {
  return ownCars.value?.find((row) => row.name === name)?.label ?? name;
}

export function keep(own: OwnCar): void {
  batch(() => {
    shownCar.value = own;
    const others = (ownCars.value ?? []).filter(({ name }) => name !== own.name);
    ownCars.value = [...others, own].sort((a, b) => a.label.localeCompare(b.label));
  });
}

/** Add a car of the kind that is chosen on the page. */
export async function addCar(name: string): Promise<void> {
  const { figures, vehicle: chosen = DESCRIBED } = car.value ?? {};
  const kind = figures ?? vehicle.value?.name ?? chosen;
  const made = await asked(() => createCar({ name, car: kind }));
  if (made) keep(made);
}

export async function showCar(name: string): Promise<void> {
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
    if (car.value?.own === name && vehicle.value) car.value = { ...car.value, own: "" };
  });
}

export const tokenOf = (name: string) => asked(() => newCarToken(name));

/** Show the progress of a car that learns until it has learned. */
export async function follow(name: string): Promise<void> {
  while (shownCar.value?.name === name && learns.value) {
    await pause(LOOK_AGAIN_MS);
    const own = await asked(() => getCar(name));
    if (!own) return;
    if (shownCar.value?.name === name) keep(own);
  }
  // forecasts of the page by this car are those of what it has learned
  if (car.value?.own === name) car.value = { ...car.value };
}
