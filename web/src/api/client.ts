/** Requests to the service that served the page, and to no other host. */

import type { Answer, Example, ExampleSummary, Model, Problem, Route, Vehicle } from "./types";

const TOKEN = "tripwatt.token";
const MOST_TRIES = 3;

/** Types of problems that arise on the page itself. */
export const UNREACHABLE = "unreachable";
export const FAILED = "failed";

/** A request without a result: the service is not reached, or answers with a problem document. */
export class Refused extends Error {
  constructor(readonly problem: Problem) {
    super(problem.detail || problem.title);
  }
}

type AskForToken = (again: boolean) => Promise<string>;
let askForToken: AskForToken = () => Promise.reject(new TypeError());

/** Set what asks for a token when the service requires one. */
export function whenTokenIsWanted(ask: AskForToken): void {
  askForToken = ask;
}

async function problemOf(response: Response): Promise<Problem> {
  const plain = { type: FAILED, title: response.statusText, status: response.status, detail: "" };
  if (!response.headers.get("content-type")?.includes("json")) return plain;
  return { ...plain, ...((await response.json()) as Partial<Problem>) };
}

async function send(path: string, init: RequestInit): Promise<Response> {
  const headers = new Headers(init.headers);
  const token = sessionStorage.getItem(TOKEN);
  // eslint-disable-next-line page/text -- a scheme of HTTP
  if (token) headers.set("authorization", `Bearer ${token}`);
  try {
    return await fetch(path, { ...init, headers });
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new Refused({ type: UNREACHABLE, title: "", status: 0, detail: "" });
  }
}

function pause(seconds: number): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, seconds * 1000));
}

async function ask<T>(path: string, init: RequestInit = {}): Promise<T> {
  for (let tries = 1; ; tries++) {
    const response = await send(path, init);
    if (response.ok) return (await response.json()) as T;
    const busy = response.status === 429 || response.status === 503;
    if (response.status === 401 && tries < 10) {
      sessionStorage.setItem(TOKEN, await askForToken(tries > 1));
    } else if (busy && tries < MOST_TRIES) {
      await pause(Math.min(Number(response.headers.get("retry-after")) || 0.5, 5));
    } else {
      throw new Refused(await problemOf(response));
    }
  }
}

function post<T>(path: string, body: BodyInit, type: string, signal?: AbortSignal): Promise<T> {
  return ask<T>(path, {
    method: "POST",
    body,
    headers: { "content-type": type },
    ...(signal && { signal }),
  });
}

export const listModels = async () => (await ask<{ models: Model[] }>("v1/models")).models;
export const listVehicles = async () => (await ask<{ vehicles: Vehicle[] }>("v1/vehicles")).vehicles;
export const listExamples = async () => (await ask<{ examples: ExampleSummary[] }>("v1/examples")).examples;
export const loadExample = (trip: string) => ask<Example>(`v1/examples/${encodeURIComponent(trip)}`);

export const forecast = (body: string, signal?: AbortSignal) =>
  post<Answer>("v1/forecast", body, "application/json", signal);

export const forecastUpdate = (body: string, signal?: AbortSignal) =>
  post<Answer>("v1/forecast/update", body, "application/json", signal);

/** What an uploaded or pasted route holds; its kind is told from its content. `speedMS` is for tracks without times. */
export const readRoute = (text: string, speedMS: number) =>
  post<Route>(`v1/routes?speed_m_s=${speedMS}`, text, "application/octet-stream");
