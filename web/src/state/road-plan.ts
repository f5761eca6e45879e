/** The trip of the page as the plan of a car on the road. */

import { batch, computed } from "@preact/signals";
import { putPlan, RequestFailed } from "../api/client";
import { atMotorwaySpeed } from "../model/links";
import { conditions, fieldsOf } from "./conditions";
import { chosenRoad, journey } from "./journey";
import { followed, live, planFailed } from "./live-drive";
import { trip } from "./trip";

/** The road of the page's trip as fields of a plan; null where it has none that a car can follow. */
const road = computed(() => {
  const now = trip.value;
  if (now?.links) {
    return { ...now.fixed, links: atMotorwaySpeed(now.links, conditions.value.motorwayMS) };
  }
  const shown = now?.stops ? journey.value?.roads[chosenRoad.value] : undefined;
  return shown ? { links: shown.links, elevation: shown.elevation } : null;
});

/** Where the trip of the page ends, in words. */
const destination = computed(() => {
  const { stops, pauseS = null } = trip.value ?? {};
  return stops?.at(pauseS === null ? -1 : 0)?.name ?? null;
});

export const canPlan = computed(() => road.value !== null);

/** Give the followed car the trip of the page as its plan; charge and temperatures are those that the car sends. */
export async function planFromPage(): Promise<void> {
  const more = fieldsOf({ ...conditions.value, beforeDeparture: "unknown" }, {});
  delete more.soc;
  delete more.ambient_temperature_degc;
  const car = followed.value;
  if (road.value === null || !car) return;
  planFailed.value = false;
  try {
    const state = await putPlan(car, { ...road.value, ...more, destination: destination.value });
    batch(() => {
      if (followed.value === car) live.value = state;
    });
  } catch (error) {
    if (!(error instanceof RequestFailed)) throw error;
    planFailed.value = true;
  }
}
