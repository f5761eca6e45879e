/** A car on the road: its stream of forecasts, the age of its last message, and a screen that stays on. */

import { batch, computed, effect, signal } from "@preact/signals";
import { listenTo, listRoadCars, RequestFailed, storeToken } from "../api/client";
import type { LiveCar, RoadCar } from "../api/documents";
import { pause } from "../model/clock";
import { viewFrom } from "../model/to-phone";
import { dark, readStored, writeStored } from "./preferences";

const KEY = "tripwatt.drive";
const NOT_FOUND = 404;
const FIRST_WAIT_MS = 2000;
const MOST_WAIT_MS = 30_000;
const TICK_MS = 1000;
/** The service sends at least a comment every 15 s: a stream without one for so long is broken. */
const SILENT_STREAM_MS = 45_000;

/** Whether the view of a car on the road is open. */
export const isOpen = signal(false);
/** Cars that can send messages; null until they are known. */
export const roadCars = signal<RoadCar[] | null>(null);
/** Name of the car that is followed; empty for none. */
export const followed = signal("");
export const live = signal<LiveCar | null>(null);
/** Of the stream; `gone` when the service follows this car no longer. */
export const link = signal<"connecting" | "open" | "lost" | "gone">("connecting");
/** Whether the screen stays on: by the browser, not, or unknown yet. */
export const awake = signal<boolean | null>(null);

/** Whether the service refused the last plan. */
export const planFailed = signal(false);

const chosenNight = signal<boolean | null>(readStored<{ night: boolean }>(KEY).night ?? null);
export const night = computed(() => chosenNight.value ?? dark.value);

const nowMs = signal(0);
let receivedMs = 0;

/** Time since the last message of the car [s]; null before the first. */
export const quietS = computed(() => {
  const at = live.value?.seconds_since_message ?? null;
  return at === null ? null : at + Math.max(0, nowMs.value - receivedMs) / 1000;
});

export function toggleNight(): void {
  chosenNight.value = !night.value;
  writeStored(KEY, { night: chosenNight.value });
}

let heardMs = 0;

/** Read one connection to its end, or until it is silent. */
async function readStream(name: string, stop: AbortSignal): Promise<void> {
  const own = new AbortController();
  const end = () => own.abort();
  stop.addEventListener("abort", end);
  heardMs = performance.now();
  const watch = setInterval(() => {
    if (performance.now() - heardMs > SILENT_STREAM_MS) end();
  }, TICK_MS);
  try {
    for await (const events of listenTo(name, own.signal)) {
      heardMs = performance.now();
      const last = events.at(-1);
      batch(() => {
        link.value = "open";
        if (last === undefined) return;
        receivedMs = nowMs.value = performance.now();
        live.value = JSON.parse(last) as LiveCar;
      });
    }
  } finally {
    clearInterval(watch);
    stop.removeEventListener("abort", end);
  }
}

async function keepListening(name: string, stop: AbortSignal): Promise<void> {
  let waitMs = FIRST_WAIT_MS;
  while (!stop.aborted) {
    try {
      await readStream(name, stop);
    } catch (error) {
      if (!stop.aborted && error instanceof RequestFailed && error.problem.status === NOT_FOUND) {
        link.value = "gone";
        return;
      }
    }
    if (stop.aborted) return;
    waitMs = link.value === "open" ? FIRST_WAIT_MS : Math.min(2 * waitMs, MOST_WAIT_MS);
    link.value = "lost";
    await pause(waitMs, stop);
  }
}

/** Show the cars on the road; where there is only one, or one is on a trip, it is followed at once. */
export async function openRoad(name = ""): Promise<void> {
  isOpen.value = true;
  followed.value = name;
  try {
    roadCars.value = await listRoadCars();
  } catch {
    link.value = "lost";
    return;
  }
  const rows = roadCars.value;
  const driving = rows.filter((row) => row.trip);
  const [only] = driving.length === 1 ? driving : rows;
  if (!followed.value && only && (rows.length === 1 || driving.length === 1)) followed.value = only.car;
}

/** Open the view that an address for a phone names; its token is kept, and both leave the address bar. */
export function openFromAddress(): void {
  const view = viewFrom(location.hash);
  if (!view) return;
  if (view.token) storeToken(view.token);
  history.replaceState(null, "", location.pathname + location.search);
  void openRoad(view.car);
}

export function closeRoad(): void {
  batch(() => {
    isOpen.value = false;
    followed.value = "";
  });
}

async function stayAwake(stop: AbortSignal): Promise<void> {
  if (!("wakeLock" in navigator)) {
    awake.value = false;
    return;
  }
  try {
    const lock = await navigator.wakeLock.request("screen");
    awake.value = true;
    lock.addEventListener("release", () => {
      awake.value = stop.aborted ? null : false;
    });
    if (stop.aborted) await lock.release();
    stop.addEventListener("abort", () => void lock.release());
  } catch {
    awake.value = false; // such as a battery that is low, or a connection that is not secure
  }
}

/** Follow the chosen car while the view is open. */
export function keepOnRoad(): void {
  effect(() => {
    const name = followed.value;
    if (!isOpen.value || !name) return undefined;
    const stop = new AbortController();
    batch(() => {
      live.value = null;
      link.value = "connecting";
      planFailed.value = false;
    });
    void keepListening(name, stop.signal);
    return () => stop.abort();
  });
  effect(() => {
    if (!isOpen.value) return undefined;
    const stop = new AbortController();
    const again = () => {
      if (document.visibilityState === "visible") void stayAwake(stop.signal);
    };
    again();
    document.addEventListener("visibilitychange", again);
    const clock = setInterval(() => {
      nowMs.value = performance.now();
    }, TICK_MS);
    return () => {
      clearInterval(clock);
      document.removeEventListener("visibilitychange", again);
      stop.abort();
    };
  });
}
