/** The chosen trip: an example, a file or links. */

import { signal } from "@preact/signals";
import type {
  Columns,
  Example,
  Flag,
  ForecastRequest,
  JourneyRequest,
  Link,
  Place,
  Route,
  Samples,
} from "../api/documents";
import { type Kind, linksOfDistance } from "../model/distance";
import { atMotorwaySpeed } from "../model/links";
import { type Profile, profileFromSamples } from "../model/profile";
import { STATION_KIND, type StationChoice } from "../model/stations";
import type { Car } from "./car";
import {
  type Conditions,
  conditions,
  conditionsFrom,
  conditionsOfJourney,
  fieldsOf,
  type StartTemperatures,
  startTemperaturesFrom,
  USUAL,
} from "./conditions";

const ROAD = ["time_s", "speed_m_s", "elevation_m", "grade"];
const MEASURED = ["time_s", "voltage_v", "current_a", "bms_soc", "displayed_soc"];

export type Source = "journey" | "distance" | "examples" | "upload" | "links";

export interface Trip {
  /** Name of the example; empty for an upload or links. */
  example: string;
  source: Source;
  /** The car that was measured; empty where it is unknown. */
  vehicle: string;
  /** Title of the example or name of the file; empty for pasted links. */
  title: string;
  notes: Flag[];
  /** Fields of the request that no slider changes: the speed trace, or the elevation of links. */
  fixed: Pick<ForecastRequest, "samples" | "elevation">;
  links: Link[] | null;
  /** The places of a journey; its forecasts come with its roads. */
  stops: Place[] | null;
  /** Of a journey: the pause before its way back to the start [s]; null for none. */
  pauseS?: number | null;
  /** Of a journey: which charging stations are wanted. */
  choice?: StationChoice;
  /** Whether an end of the journey is being dragged, so that only the arrival is asked for. */
  isDraft?: boolean;
  /** Of a trip by distance: it is no forecast of a road. */
  distance?: { distanceM: number; kind: Kind };
  profile: Profile;
  observed: Columns | null;
  logged: StartTemperatures;
  /** Conditions of the log or the example. */
  start: Conditions;
}

const UNKNOWN: Profile = profileFromSamples({});

/** A trip of which nothing is known. */
const BARE = {
  example: "",
  vehicle: "",
  title: "",
  notes: [],
  fixed: {},
  links: null,
  stops: null,
  profile: UNKNOWN,
  observed: null,
  logged: {},
};

export const trip = signal<Trip | null>(null);

function pick(columns: Columns, names: string[]): Columns {
  return Object.fromEntries(Object.entries(columns).filter(([name]) => names.includes(name)));
}

export function tripFromExample(example: Example): Trip {
  const { samples, ...known } = example.request;
  return {
    ...BARE,
    example: example.trip,
    source: "examples",
    vehicle: example.car,
    title: example.title,
    fixed: { samples: samples as Samples },
    profile: profileFromSamples(samples as Samples),
    observed: example.observed,
    logged: startTemperaturesFrom(known),
    start: conditionsFrom(known, USUAL),
  };
}

/** The first sample, with the displayed state of charge as `soc`. */
function firstOf(samples: Columns): Record<string, unknown> {
  const first = Object.fromEntries(Object.entries(samples).map(([name, column]) => [name, column[0]]));
  return { ...first, soc: first.displayed_soc };
}

function isMeasured(columns: Columns): boolean {
  return (
    ("voltage_v" in columns && "current_a" in columns) || "bms_soc" in columns || "displayed_soc" in columns
  );
}

export function tripFromRoute(route: Route, title: string, source: Source): Trip {
  const links = route.links ?? null;
  const first = firstOf(route.samples);
  const measured = pick(route.samples, MEASURED);
  return {
    ...BARE,
    source,
    title,
    notes: route.notes,
    fixed: links ? { elevation: route.elevation } : { samples: pick(route.samples, ROAD) as Samples },
    links,
    profile: profileFromSamples(route.samples),
    observed: isMeasured(measured) ? measured : null,
    logged: startTemperaturesFrom(first),
    start: conditionsFrom(first, conditions.value),
  };
}

/** A trip of which only distance and kind of road are known; its links are assumed. */
export function tripFromDistance(distanceM: number, kind: Kind): Trip {
  return {
    ...BARE,
    source: "distance",
    links: linksOfDistance(distanceM, kind),
    distance: { distanceM, kind },
    start: conditionsFrom({}, conditions.value),
  };
}

/** The car as members of a request. */
export function fieldsOfCar(car: Car | null): Pick<ForecastRequest, "car" | "model"> {
  if (!car) return {};
  const { vehicle, model, figures, own } = car;
  return own ? { car: own } : { car: figures ?? vehicle, model };
}

/** A place as a stop of a request, to charge if it is a station. */
export function stopOf({ name, latitude_deg, longitude_deg, kind }: Place) {
  const place = { name, latitude_deg, longitude_deg };
  return kind === STATION_KIND ? { ...place, kind } : place;
}

/** A journey from place to place as a trip; its road comes with its forecast. `isDraft` while an end is dragged. */
export function tripFromStops(
  stops: Place[],
  pauseS: number | null,
  choice: StationChoice,
  isDraft: boolean,
): Trip {
  const names = stops.map(({ name }) => name);
  return {
    ...BARE,
    source: "journey",
    title: [...names, ...(pauseS !== null ? names.slice(0, 1) : [])].join(" – "),
    stops,
    pauseS,
    choice,
    isDraft,
    start: conditionsFrom({}, conditions.value),
  };
}

/** A request for the forecast of a trip. */
export function forecastRequest(of: Trip, at: Conditions, car: Car | null): ForecastRequest {
  const links = of.links && { links: atMotorwaySpeed(of.links, at.motorwayMS) };
  return { ...of.fixed, ...links, ...fieldsOfCar(car), ...fieldsOf(at, of.logged) };
}

/** A request for a journey from place to place. */
export function journeyRequest(
  { stops, pauseS = null, choice }: Trip,
  at: Conditions,
  car: Car | null,
): JourneyRequest {
  return {
    stops: (stops ?? []).map(stopOf),
    ...(pauseS !== null && { round_trip: true, pause_s: pauseS }),
    ...(choice?.avoid.length && { avoid: choice.avoid.map(stopOf) }),
    ...(choice?.networks.length && { networks: [...choice.networks] }),
    ...(at.preheatForStops && { preheat_battery: true }),
    ...fieldsOfCar(car),
    stop_overhead_s: at.stopOverheadS,
    ...conditionsOfJourney(at),
  };
}
