/** The position along the way that all charts show. */

import { computed, effect, signal } from "@preact/signals";
import { chargingPlan } from "./charging";
import { distanceM, driving, shownProfile } from "./drive";
import { trip } from "./trip";

/** Distance selected with the pointer or the position slider [m]; null for none. */
export const selectedM = signal<number | null>(null);

export const lengthM = computed(
  () => chargingPlan.value?.course.position_m.at(-1) ?? shownProfile.value?.distanceM.at(-1) ?? 0,
);

/** Distance of the cursors of the charts [m]: the selected one, else that of the car. */
export const positionM = computed(() => selectedM.value ?? (driving.value ? distanceM.value : null));

export function keepPosition(): void {
  effect(() => {
    if (trip.value) selectedM.value = null;
  });
}
