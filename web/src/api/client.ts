/** Requests to the service that served the page, and to no other host. */

import type {
  DescribedVehicle,
  Example,
  ExampleSummary,
  Forecast,
  Journey,
  LiveCar,
  LogsReading,
  MapInfo,
  MapView,
  Model,
  OwnCar,
  OwnCarSummary,
  Place,
  Problem,
  Reach,
  RoadCar,
  Route,
  Vehicle,
} from "./types";
import { EventParser } from "../model/sse";

const TOKEN = "tripwatt.token";
const MAX_ATTEMPTS = 3;

/** Types of problems without a problem document. */
export const UNREACHABLE = "unreachable";
export const FAILED = "failed";

/** The service is unreachable, or it returned a problem. */
export class RequestFailed extends Error {
  constructor(readonly problem: Problem) {
    super(problem.detail || problem.title);
  }
}

type TokenProvider = (again: boolean) => Promise<string>;
let requestToken: TokenProvider = () => Promise.reject(new TypeError());

/** Set the function that provides a token when the service requires one; `again` is true after a wrong token. */
export function setTokenProvider(provider: TokenProvider): void {
  requestToken = provider;
}

async function problemOf(response: Response): Promise<Problem> {
  const plain = { type: FAILED, title: response.statusText, status: response.status, detail: "" };
  if (!response.headers.get("content-type")?.includes("json")) return plain;
  return { ...plain, ...((await response.json()) as Partial<Problem>) };
}

/** Headers of requests that this module does not send itself: those of the tiles of a map. */
export function tokenHeaders(): Record<string, string> {
  const token = sessionStorage.getItem(TOKEN);
  // eslint-disable-next-line page/text -- a scheme of HTTP
  return token ? { authorization: `Bearer ${token}` } : {};
}

async function send(path: string, init: RequestInit): Promise<Response> {
  const headers = { ...(init.headers as Record<string, string>), ...tokenHeaders() };
  try {
    return await fetch(path, { ...init, headers });
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new RequestFailed({ type: UNREACHABLE, title: "", status: 0, detail: "" });
  }
}

function pause(seconds: number): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, seconds * 1000));
}

/** The response to a request that was accepted; a token is asked for where one is needed. */
async function request(path: string, init: RequestInit): Promise<Response> {
  for (let attempt = 1; ; attempt++) {
    const response = await send(path, init);
    if (response.ok) return response;
    const busy = response.status === 429 || response.status === 503;
    if (response.status === 401 && attempt < 10) {
      sessionStorage.setItem(TOKEN, await requestToken(attempt > 1));
    } else if (busy && attempt < MAX_ATTEMPTS) {
      await pause(Math.min(Number(response.headers.get("retry-after")) || 0.5, 5));
    } else {
      throw new RequestFailed(await problemOf(response));
    }
  }
}

async function requestJson<T>(path: string, init: RequestInit = {}): Promise<T> {
  return (await (await request(path, init)).json()) as T;
}

function post<T>(path: string, body: BodyInit, type: string, signal?: AbortSignal): Promise<T> {
  return requestJson<T>(path, {
    method: "POST",
    body,
    headers: { "content-type": type },
    ...(signal && { signal }),
  });
}

export const listModels = async () => (await requestJson<{ models: Model[] }>("v1/models")).models;
export const listVehicles = async () => (await requestJson<{ vehicles: Vehicle[] }>("v1/vehicles")).vehicles;
export const findVehicles = async (words: string, signal?: AbortSignal) => {
  const path = `v1/vehicles?search=${encodeURIComponent(words)}`;
  return (await requestJson<{ vehicles: Vehicle[] }>(path, { ...(signal && { signal }) })).vehicles;
};
export const describeCar = (figures: string) =>
  post<DescribedVehicle>("v1/vehicles", figures, "application/json");
export const listExamples = async () =>
  (await requestJson<{ examples: ExampleSummary[] }>("v1/examples")).examples;
export const loadExample = (trip: string) => requestJson<Example>(`v1/examples/${encodeURIComponent(trip)}`);

export const listCars = async () => (await requestJson<{ cars: OwnCarSummary[] | null }>("v1/cars")).cars;
const pathOf = (car: string) => `v1/cars/${encodeURIComponent(car)}`;
export const createCar = (body: string) => post<OwnCar>("v1/cars", body, "application/json");
export const getCar = (car: string) => requestJson<OwnCar>(pathOf(car));
export const forgetCar = (car: string) =>
  requestJson<{ forgotten: string }>(pathOf(car), { method: "DELETE" });
export const newCarToken = async (car: string) =>
  (await requestJson<{ token: string }>(`${pathOf(car)}/token`, { method: "POST" })).token;

/** Send a file of logs; files of one upload are read together. */
export const sendFile = (car: string, upload: string, file: File) =>
  requestJson<{ files: number; bytes: number }>(
    `${pathOf(car)}/uploads/${upload}/${encodeURIComponent(file.name)}`,
    { method: "PUT", body: file, headers: { "content-type": "application/octet-stream" } },
  );
export const readLogs = (car: string, upload: string, body: string) =>
  post<LogsReading>(`${pathOf(car)}/uploads/${upload}`, body, "application/json");
export const learnLogs = (car: string, upload: string, body: string) =>
  post<OwnCar>(`${pathOf(car)}/uploads/${upload}/learn`, body, "application/json");

/** Cars that can send messages while they drive. */
export const listRoadCars = async () => (await requestJson<{ vehicles: RoadCar[] }>("v1/live")).vehicles;

/** Give a car the plan of its trip, or of its next one. */
export const putPlan = (car: string, body: string) =>
  requestJson<LiveCar>(`v1/live/${encodeURIComponent(car)}/plan`, {
    method: "PUT",
    body,
    headers: { "content-type": "application/json" },
  });

/** The events of a car on the road, as they come: the data of each, and nothing for a sign of life. */
export async function* listenTo(car: string, signal: AbortSignal): AsyncGenerator<string[], void> {
  const headers = { accept: "text/event-stream" };
  const { body } = await request(`v1/live/${encodeURIComponent(car)}/events`, { headers, signal });
  const reader = body?.pipeThrough(new TextDecoderStream()).getReader();
  const parser = new EventParser();
  for (let part = await reader?.read(); part && !part.done; part = await reader?.read()) {
    yield parser.take(part.value);
  }
}

export const requestForecast = (body: string, signal?: AbortSignal) =>
  post<Forecast>("v1/forecast", body, "application/json", signal);

export const requestUpdate = (body: string, signal?: AbortSignal) =>
  post<Forecast>("v1/forecast/update", body, "application/json", signal);

export const getMap = () => requestJson<MapInfo>("v1/map");

/** Places whose names begin with the words of a text, the best first. */
export const findPlaces = async (words: string, signal?: AbortSignal) => {
  const found = await requestJson<{ places: Place[] }>(`v1/places?limit=6&q=${encodeURIComponent(words)}`, {
    ...(signal && { signal }),
  });
  return found.places;
};

export const planJourney = (body: string, signal?: AbortSignal) =>
  post<Journey>("v1/plan", body, "application/json", signal);

export const findReach = (body: string, signal?: AbortSignal) =>
  post<Reach>("v1/reachable", body, "application/json", signal);

/** Settlements and charging stations inside of south, west, north and east. */
export const viewMap = ([south, west, north, east]: readonly number[], signal?: AbortSignal) =>
  requestJson<MapView>(`v1/map/view?south=${south}&west=${west}&north=${north}&east=${east}`, {
    ...(signal && { signal }),
  });

/** URL of the tiles of the map, with {z}, {x} and {y}. */
export const tilesUrl = () => `${new URL("v1/tiles", document.baseURI).href}/{z}/{x}/{y}`;

/** Reads a route of any supported format. `speedMS` is the speed of tracks without times, 0 for none. */
export const readRoute = (text: string, speedMS: number) =>
  post<Route>(`v1/routes${speedMS > 0 ? `?speed_m_s=${speedMS}` : ""}`, text, "application/octet-stream");
