/** The chosen car and the chosen model. */

import { computed, signal } from "@preact/signals";
import type { Figures, Model, OwnCarSummary, Vehicle } from "../api/documents";

/** Name of the car that its driver describes. */
export const DESCRIBED = "";

export interface Car {
  vehicle: string;
  model: string;
  /** Figures of a car that the service does not have; `vehicle` is then `DESCRIBED`. */
  figures?: Figures;
  /** What the described car is called. */
  title?: string;
  /** Name of a car of the service that learns from its trips; `model` is then that of the trips it begins with. */
  own?: string;
}

/** What a car of the service is chosen by. */
type Owned = Pick<OwnCarSummary, "name" | "car" | "title">;

export const models = signal<Model[]>([]);
export const vehicles = signal<Vehicle[]>([]);
export const car = signal<Car | null>(null);

export const vehicle = computed(() => vehicles.value.find(({ name }) => name === car.value?.vehicle) ?? null);
export const model = computed(() => models.value.find(({ name }) => name === car.value?.model) ?? null);

/** Models for the car: those fitted on its trips, or all when there are none. */
export const choices = computed(() => {
  const own = vehicle.value?.models ?? [];
  return models.value.filter(({ name }) => own.length === 0 || own.includes(name));
});

/** Whether the model was fitted on trips of the chosen car. */
export const isMeasured = computed(() => !!car.value?.own || model.value?.model.car === car.value?.vehicle);

export function chooseVehicle(name: string): void {
  const [own] = vehicles.value.find((row) => row.name === name)?.models ?? [];
  const next = own ?? car.value?.model ?? models.value[0]?.name;
  if (next) car.value = { vehicle: name, model: next };
}

export function chooseDescribed(figures: Figures, title: string): void {
  const any = car.value?.model ?? models.value[0]?.name;
  if (any) car.value = { vehicle: DESCRIBED, model: any, figures, title };
}

/** Choose a car of the service; `car` is the car of the library that it is. */
export function chooseOwn({ name: own, car: of, title }: Owned): void {
  const any = car.value?.model ?? models.value[0]?.name;
  const known = vehicles.value.some(({ name }) => name === of);
  if (any) car.value = { vehicle: known ? of : DESCRIBED, model: any, title, own };
}

export function chooseModel(name: string): void {
  if (car.value) car.value = { ...car.value, model: name };
}

/**
 * Choose the car and the model of the last visit, if the service still has them.
 *
 * Else the car of the service, where it keeps exactly one, else that of the first model.
 */
export function chooseFirst(last: Partial<Car> | undefined, owned: readonly Owned[] = []): void {
  const known = models.value.find(({ name }) => name === last?.model) ?? models.value[0];
  if (!known) return;
  car.value = { model: known.name, vehicle: known.model.car };
  const own = owned.find(({ name }) => (last ? name === last.own : owned.length === 1));
  if (own) chooseOwn(own);
  else if (last?.figures && last.title)
    car.value = { model: known.name, vehicle: DESCRIBED, figures: last.figures, title: last.title };
  else if (vehicles.value.some(({ name }) => name === last?.vehicle))
    car.value = { ...car.value, vehicle: last?.vehicle as string };
}
