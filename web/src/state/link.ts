/** The plan of the page as its link: it survives a reload, goes back and forward, and can be shared. */

import { effect, untracked } from "@preact/signals";
import { FIELDS } from "../../generated/fields";
import { Latest } from "../api/latest";
import { notPast } from "../model/clock";
import { KINDS } from "../model/distance";
import { changedFrom, changedText, figuresFrom, placeFrom, placeText } from "../model/link";
import { STATION_KIND } from "../model/stations";
import { type Car, car } from "./car";
import { BEFORE_DEPARTURE, type Conditions, conditions, USUAL } from "./conditions";
import { isExample } from "./journey";
import { readStored, writeStored } from "./preferences";
import { type Trip, trip } from "./trip";

const KEY = "tripwatt.last";
/** Between two writes; browsers allow few in a short time. */
const REST_MS = 400;

type Names = keyof Conditions;

function kindOf(name: string): "number" | "string" | "boolean" | "list" {
  const field = (FIELDS as Record<string, object>)[name];
  if (field) return "unit" in field ? "number" : "several" in field ? "list" : "string";
  const usual = USUAL[name as Names];
  if (typeof usual === "boolean") return "boolean";
  return typeof usual === "number" || name === "motorwayMS" ? "number" : "string";
}

/** Whether each choice is one of its field. */
function checked(found: Conditions): Conditions {
  const next: Record<string, unknown> = { ...found };
  for (const [name, field] of Object.entries(FIELDS)) {
    if (!("choices" in field)) continue;
    const choices: readonly string[] = field.choices;
    const value = next[name];
    if (typeof value === "string" && !choices.includes(value)) next[name] = USUAL[name as Names];
    if (Array.isArray(value)) next[name] = value.filter((one) => choices.includes(one as string));
  }
  if (!BEFORE_DEPARTURE.includes(found.beforeDeparture)) next.beforeDeparture = USUAL.beforeDeparture;
  return { ...(next as unknown as Conditions), departsAt: notPast(found.departsAt) };
}

function carFrom(link: URLSearchParams): Partial<Car> | null {
  const vehicle = link.get("vehicle");
  if (vehicle === null) return null;
  const figures = figuresFrom(link.get("figures"));
  const own = link.get("own");
  return {
    vehicle,
    model: link.get("model") ?? "",
    title: link.get("title") ?? "",
    ...(figures && { figures }),
    ...(own !== null && { own }),
  };
}

/** What a link has. */
export type Linked = NonNullable<ReturnType<typeof readLink>>;

/** What the text of a link has; null for a text that is none. */
export function readLink(hash: string) {
  const link = new URLSearchParams(hash.replace(/^#/, ""));
  const found = link.get("trip");
  if (found === null) return null;
  const places = [...link]
    .filter(([name]) => name === "place" || name === "station")
    .map(([name, text]) => {
      const place = placeFrom(text);
      return place && name === "station" ? { ...place, kind: STATION_KIND } : place;
    });
  const avoid = link.getAll("avoid").map(placeFrom);
  const isWhole = places.length >= 2 && places.every((place) => place !== null);
  const distanceM = Number(link.get("distance_m"));
  const kind = KINDS.find((name) => name === link.get("road"));
  return {
    source: (["journey", "distance", "examples"] as const).find((name) => name === found) ?? null,
    places: isWhole ? places : null,
    pauseS: link.get("round_trip") === "true" ? Number(link.get("pause_s")) || 0 : null,
    choice: { avoid: avoid.filter((place) => place !== null), networks: link.getAll("network") },
    example: link.get("example") ?? "",
    distance: distanceM > 0 && kind ? { distanceM, kind } : null,
    conditions: checked(changedFrom(link, USUAL, kindOf)),
    car: carFrom(link),
  };
}

/** The link of the last visit. */
export function lastLink(): Linked | null {
  const { link } = readStored<{ link: string }>(KEY);
  return typeof link === "string" ? readLink(link) : null;
}

function tripText({ source, stops, pauseS = null, choice, example, distance }: Trip): [string, string][] {
  if (stops) {
    return [
      ["trip", "journey"],
      ...stops.map((place): [string, string] => [
        place.kind === STATION_KIND ? "station" : "place",
        placeText(place),
      ]),
      ...(pauseS === null ? [] : Object.entries({ round_trip: "true", pause_s: String(pauseS) })),
      ...(choice?.avoid ?? []).map((place): [string, string] => ["avoid", placeText(place)]),
      ...(choice?.networks ?? []).map((network): [string, string] => ["network", network]),
    ];
  }
  if (distance) {
    const distance_m = String(Math.round(distance.distanceM));
    return Object.entries({ trip: "distance", distance_m, road: distance.kind });
  }
  return source === "examples" ? Object.entries({ trip: "examples", example }) : [];
}

function carText({ vehicle, model, figures, title, own }: Car): [string, string][] {
  const known = { vehicle, model, title, own, figures: figures && JSON.stringify(figures) };
  return Object.entries(known).filter((part): part is [string, string] => !!part[1] || part[0] === "vehicle");
}

/** The link of a trip; empty for one that no link can have: a file, or sections that were typed. */
export function linkOf(of: Trip, at: Conditions, by: Car | null): string {
  const road = tripText(of);
  if (road.length === 0) return "";
  const car = by ? carText(by) : [];
  return `#${new URLSearchParams([...road, ...changedText(at, USUAL), ...car]).toString()}`;
}

/** Whether the page is a link's place in the history: another trip begins a new entry. */
let entered: Trip | null = null;

/** Keep the address of the page, and the link of the next visit, up to date. `open` shows a link of the history. */
export function keepLink(open: (linked: Linked) => void): void {
  let isDue = false;
  const write = () => {
    const now = trip.peek();
    if (!isDue || !now || now.isDraft) return;
    isDue = false;
    const link = linkOf(now, conditions.peek(), car.peek());
    const isNew = entered !== null && JSON.stringify(tripText(entered)) !== JSON.stringify(tripText(now));
    entered = now;
    if (link && !isExample.peek()) writeStored(KEY, { link });
    const address = link || location.pathname + location.search;
    if (link === location.hash) return;
    if (isNew) history.pushState(null, "", address);
    else history.replaceState(null, "", address);
  };
  const writer = new Latest<true>(async () => write(), REST_MS);
  effect(() => {
    isDue = !!(trip.value && !trip.value.isDraft && conditions.value && car.value);
    if (isDue) untracked(() => writer.submit(true));
  });
  // who leaves the page within the rest finds the last change again
  window.addEventListener("pagehide", write);
  document.addEventListener("visibilitychange", write);
  window.addEventListener("popstate", () => {
    const linked = readLink(location.hash);
    isDue = false;
    entered = null;
    if (linked) open(linked);
  });
}
