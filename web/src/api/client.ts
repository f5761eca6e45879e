/** Requests to the service that served the page, and to no other host. */

import { pause } from "../model/clock";
import { EventParser } from "../model/sse";
import type { LivePlanRequest, LogsRequest, Need, Problem } from "./documents";
import type { paths } from "../../generated/types";

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
  const plain: Problem = { type: FAILED, title: response.statusText, status: response.status, detail: "" };
  if (!response.headers.get("content-type")?.includes("json")) return plain;
  return { ...plain, ...((await response.json()) as Partial<Problem>) };
}

/** The token of the service that this tab has; empty for none. */
export function storedToken(): string {
  return sessionStorage.getItem(TOKEN) ?? "";
}

export function storeToken(token: string): void {
  sessionStorage.setItem(TOKEN, token);
}

/** Headers of requests that this module does not send itself: those of the tiles of a map. */
export function tokenHeaders(): Record<string, string> {
  const token = storedToken();
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

/** The response to a request that was accepted; a token is asked for where one is needed. */
async function request(path: string, init: RequestInit): Promise<Response> {
  for (let attempt = 1; ; attempt++) {
    const response = await send(path, init);
    if (response.ok) return response;
    const busy = response.status === 429 || response.status === 503;
    if (response.status === 401 && attempt < 10) {
      storeToken(await requestToken(attempt > 1));
    } else if (busy && attempt < MAX_ATTEMPTS) {
      await pause(1000 * Math.min(Number(response.headers.get("retry-after")) || 0.5, 5));
    } else {
      throw new RequestFailed(await problemOf(response));
    }
  }
}

type Method = "get" | "post" | "put" | "delete";
type Json<T> = T extends { content: { "application/json": infer Document } } ? Document : never;
type Answer<O> = O extends { responses: { 200: infer Response } } ? Json<Response> : never;
type Body<O> = O extends { requestBody: infer Content } ? Json<Content> : never;
type Given<O> = O extends { parameters: infer Parameters } ? Parameters : never;

/** The values of a query; a null is left out of the URL. */
type OrNull<V> = { [K in keyof V]: V[K] | null };

/** What a request has beside its path. */
interface Call<O> {
  path?: Given<O> extends { path: infer Values } ? Values : never;
  query?: Given<O> extends { query?: infer Values } ? OrNull<Values> : never;
  body?: Body<O>;
  /** A body that is no JSON document. */
  bytes?: BodyInit;
  signal?: AbortSignal | undefined;
}

/** A template of the OpenAPI document with its values, below the folder of the page. */
function pathOf(template: string, values: object = {}, query: object = {}): string {
  const named = new Map<string, unknown>(Object.entries(values));
  const path = template.slice(1).replaceAll(/\{(\w+)\}/g, (_, name: string) => {
    return encodeURIComponent(String(named.get(name)));
  });
  const search = new URLSearchParams(
    Object.entries(query).flatMap(([name, value]) =>
      (Array.isArray(value) ? value : value === null ? [] : [value]).map((one) => [name, String(one)]),
    ),
  );
  return search.size > 0 ? `${path}?${search}` : path;
}

/** The answer to a request of the OpenAPI document. */
async function ask<M extends Method, P extends keyof paths>(
  method: M,
  template: P,
  { path, query, body, bytes, signal }: Call<paths[P][M]> = {},
): Promise<Answer<paths[P][M]>> {
  const type = bytes === undefined ? "application/json" : "application/octet-stream";
  const content = body === undefined ? bytes : JSON.stringify(body);
  const init: RequestInit = { method: method.toUpperCase() };
  if (content !== undefined) Object.assign(init, { body: content, headers: { "content-type": type } });
  if (signal) init.signal = signal;
  const response = await request(pathOf(template, path as object, query as object), init);
  return (await response.json()) as Answer<paths[P][M]>;
}

/** A request that sends a document. */
const posting =
  <P extends keyof paths>(template: P) =>
  (body: Body<paths[P]["post"]>, signal?: AbortSignal) =>
    ask("post", template, { body, signal });

export const listModels = async () => (await ask("get", "/v1/models")).models;
export const listVehicles = async () => (await ask("get", "/v1/vehicles")).vehicles;
export const findVehicles = async (search: string, signal?: AbortSignal) =>
  (await ask("get", "/v1/vehicles", { query: { search }, signal })).vehicles;
export const describeCar = posting("/v1/vehicles");
export const listExamples = async () => (await ask("get", "/v1/examples")).examples;
export const loadExample = (trip: string) => ask("get", "/v1/examples/{trip}", { path: { trip } });

export const listCars = () => ask("get", "/v1/cars");
export const createCar = posting("/v1/cars");
export const getCar = (car: string) => ask("get", "/v1/cars/{car}", { path: { car } });
export const forgetCar = (car: string) => ask("delete", "/v1/cars/{car}", { path: { car } });
export const newCarToken = async (car: string) =>
  (await ask("post", "/v1/cars/{car}/token", { path: { car } })).token;

/** Send a file of logs; files of one upload are read together. */
export const sendFile = (car: string, upload: string, file: File) =>
  ask("put", "/v1/cars/{car}/uploads/{upload}/{file}", {
    path: { car, upload, file: file.name },
    bytes: file,
  });
export const readLogs = (car: string, upload: string, body: LogsRequest) =>
  ask("post", "/v1/cars/{car}/uploads/{upload}", { path: { car, upload }, body });
export const learnLogs = (car: string, upload: string, body: LogsRequest) =>
  ask("post", "/v1/cars/{car}/uploads/{upload}/learn", { path: { car, upload }, body });

/** Cars that can send messages while they drive. */
export const listRoadCars = async () => (await ask("get", "/v1/live")).cars;

/** Give a car the plan of its trip, or of its next one. */
export const putPlan = (car: string, body: LivePlanRequest) =>
  ask("put", "/v1/live/{car}/plan", { path: { car }, body });

/** The events of a car on the road, as they come: the data of each, and nothing for a sign of life. */
export async function* listenTo(car: string, signal: AbortSignal): AsyncGenerator<string[], void> {
  const headers = { accept: "text/event-stream" };
  const { body } = await request(pathOf("/v1/live/{car}/events", { car }), { headers, signal });
  const reader = body?.pipeThrough(new TextDecoderStream()).getReader();
  const parser = new EventParser();
  for (let part = await reader?.read(); part && !part.done; part = await reader?.read()) {
    yield parser.take(part.value);
  }
}

export const requestForecast = posting("/v1/forecast");
export const requestUpdate = posting("/v1/forecast/update");

export const getMap = () => ask("get", "/v1/map");

/** Places whose names begin with the words of a text, the best first. */
export const findPlaces = async (words: string, signal?: AbortSignal) =>
  (await ask("get", "/v1/places", { query: { q: words, limit: 6 }, signal })).places;

export const planJourney = posting("/v1/journeys");

/** What one trip takes more than another one of the same car. */
export const findDifference = posting("/v1/forecast/difference");

/** And of a road of two journeys, without their charging stops. */
export const findJourneyDifference = posting("/v1/journeys/difference");

/** What to do about a trip, or about a journey. */
export const findAdvice = posting("/v1/advice");
export const findJourneyAdvice = posting("/v1/journeys/advice");

type NeedQuery = OrNull<NonNullable<paths["/v1/need"]["get"]["parameters"]["query"]>>;
type RangeQuery = OrNull<NonNullable<paths["/v1/range"]["get"]["parameters"]["query"]>>;

/** What a distance needs, without a road. */
export const findNeed = async (query: NeedQuery, signal?: AbortSignal) =>
  (await ask("get", "/v1/need", { query, signal })) as Need;

/** How far a charge goes, without a road. */
export const findRange = (query: RangeQuery, signal?: AbortSignal) =>
  ask("get", "/v1/range", { query, signal });

export const findReach = posting("/v1/reachable");

/** Settlements and charging stations inside of south, west, north and east. */
export const viewMap = (
  [south, west, north, east]: readonly [number, number, number, number],
  signal?: AbortSignal,
) => ask("get", "/v1/map/view", { query: { south, west, north, east }, signal });

/** URL of the tiles of the map, with {z}, {x} and {y}. */
export const tilesUrl = () => `${new URL("v1/tiles", document.baseURI).href}/{z}/{x}/{y}`;

/** Reads a route of any supported format. `speedMS` is the speed of tracks without times, 0 for none. */
export const readRoute = (text: string, speedMS: number) =>
  ask("post", "/v1/routes", { bytes: text, ...(speedMS > 0 && { query: { speed_m_s: speedMS } }) });
