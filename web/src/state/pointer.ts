/** The place along the way that the reader looks at; shared by all charts. */

import { computed, effect, signal } from "@preact/signals";
import { distanceM, driving, road } from "./drive";
import { trip } from "./trip";

/** Distance from the start [m]; null for none. */
export const looked = signal<number | null>(null);

export const lengthM = computed(() => road.value?.distanceM.at(-1) ?? 0);

/** Where the charts' cursors stand: where the reader looks, else where the car is. */
export const place = computed(() => looked.value ?? (driving.value ? distanceM.value : null));

export function keepPointing(): void {
  effect(() => {
    if (trip.value) looked.value = null;
  });
}
