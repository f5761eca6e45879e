/** Where the device is, as the start of a journey: asked of the browser when the driver wants it. */

import { signal } from "@preact/signals";
import { map, placeAt, setPlace } from "./journey";

const WAIT_MS = 10_000;

/** Why there is no position; a text for each. */
export const lacksPosition = signal<"denied" | "notFound" | "outside" | null>(null);

/** Browsers give a position to encrypted pages only, and to those of the device itself. */
export const canLocate = isSecureContext && "geolocation" in navigator;

export function startHere(name: string): void {
  lacksPosition.value = null;
  navigator.geolocation.getCurrentPosition(
    ({ coords: { latitude, longitude } }) => {
      const [south = -90, west = -180, north = 90, east = 180] = map.value?.bounds_deg ?? [];
      const isInside = latitude >= south && latitude <= north && longitude >= west && longitude <= east;
      if (isInside) setPlace("from", { ...placeAt(longitude, latitude), name });
      else lacksPosition.value = "outside";
    },
    ({ code }) => {
      lacksPosition.value = code === GeolocationPositionError.PERMISSION_DENIED ? "denied" : "notFound";
    },
    { enableHighAccuracy: true, timeout: WAIT_MS },
  );
}
