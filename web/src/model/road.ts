/** The line of a road on the map: its parts by consumption, and places along it. */

import type { ChargingPlan, Place, Road } from "../api/documents";
import { interpolate } from "./interpolate";

export type Level = "low" | "usual" | "high";

export type End = "from" | "to";
/** A place of a journey: an end, or one of the places on the way by its number. */
export type Field = End | `via${number}`;

/** Longitude and latitude [°], in the order of GeoJSON. */
export type Point = [number, number];

export interface Piece {
  level: Level;
  line: Point[];
}

/** South, west, north and east [°]. */
export type Bounds = [number, number, number, number];

/** Pieces of a road whose consumption is compared with that of the whole road. */
const PIECES = 60;
/** Shares of the mean consumption beyond which a piece is low or high. */
const LOW = 0.75;
const HIGH = 1.25;

type Line = Pick<Road, "line" | "distance_m" | "forecast">;

export function pointsOf({ line }: Pick<Road, "line">): Point[] {
  return line.longitude_deg.map((longitude, k) => [longitude, line.latitude_deg[k] as number]);
}

/** Energy from the start to a position on the road [Wh]; the forecast may be on a slightly other scale of distance. */
export function energyAtWh({ forecast, distance_m: length }: Line, positionM: number): number {
  const { distance_m: along, energy_wh: energy } = forecast.series;
  return interpolate((positionM / length) * (along.at(-1) as number), along, energy);
}

/** A line in pieces of about equal length, each with its level; neighbours of one level are joined. `used` is the energy up to a position [m]. */
function piecesAlong(line: Road["line"], lengthM: number, used: (positionM: number) => number): Piece[] {
  const points = pointsOf({ line });
  const { position_m: position } = line;
  const mean = used(lengthM) / lengthM;
  const leastM = lengthM / PIECES;
  const pieces: Piece[] = [];
  for (let first = 0; first < points.length - 1;) {
    const startM = position[first] as number;
    let last = first + 1;
    while (last < points.length - 1 && (position[last] as number) - startM < leastM) last++;
    const pieceM = (position[last] as number) - startM;
    const energy = used(position[last] as number) - used(startM);
    const level = levelOf(pieceM > 0 ? energy / pieceM : mean, mean);
    const before = pieces.at(-1);
    if (before?.level === level) before.line.push(...points.slice(first + 1, last + 1));
    else pieces.push({ level, line: points.slice(first, last + 1) });
    first = last;
  }
  return pieces;
}

export function piecesOf(road: Line): Piece[] {
  return piecesAlong(road.line, road.distance_m, (positionM) => energyAtWh(road, positionM));
}

/** The pieces of a plan with charging stops: what the display loses on the way, without what it gains at stops. */
export function piecesOfPlan({ line, course }: Pick<ChargingPlan, "line" | "course">): Piece[] {
  const { position_m: position, displayed_soc: soc } = course;
  const used: number[] = [];
  for (const [k, now] of soc.entries()) {
    const isStop = k > 0 && position[k] === position[k - 1];
    used.push((used[k - 1] ?? 0) + (k === 0 || isStop ? 0 : (soc[k - 1] as number) - now));
  }
  return piecesAlong(line, position.at(-1) as number, (positionM) => interpolate(positionM, position, used));
}

function levelOf(whM: number, meanWhM: number): Level {
  if (whM > HIGH * meanWhM) return "high";
  return whM < LOW * meanWhM ? "low" : "usual";
}

/** The point at a distance along the forecast [m]. */
export function pointAt({ line, distance_m: length, forecast }: Line, distanceM: number): Point {
  const whole = forecast.series.distance_m.at(-1) as number;
  return pointAlong(line, (distanceM / whole) * length);
}

/** The point at a position on a line [m]. */
export function pointAlong(line: Road["line"], positionM: number): Point {
  return [
    interpolate(positionM, line.position_m, line.longitude_deg),
    interpolate(positionM, line.position_m, line.latitude_deg),
  ];
}

/** Distance along the forecast of the place on the road that is nearest to a point [m]. */
export function distanceNear(road: Line, point: Point): number {
  return (positionNear(road, point) / road.distance_m) * (road.forecast.series.distance_m.at(-1) as number);
}

/** Position on a line that is nearest to a point, the first one of several [m]. */
export function positionNear({ line }: Pick<Road, "line">, [longitude, latitude]: Point): number {
  const points = pointsOf({ line });
  const shrink = Math.cos((latitude * Math.PI) / 180);
  let nearest = Number.POSITIVE_INFINITY;
  let foundM = 0;
  for (let k = 1; k < points.length; k++) {
    const [x0, y0] = fromPoint(points[k - 1] as Point);
    const [x1, y1] = fromPoint(points[k] as Point);
    const [dx, dy] = [x1 - x0, y1 - y0];
    const square = dx * dx + dy * dy;
    const share = square > 0 ? Math.min(Math.max(-(x0 * dx + y0 * dy) / square, 0), 1) : 0;
    const off = Math.hypot(x0 + share * dx, y0 + share * dy);
    if (off >= nearest) continue;
    nearest = off;
    const [from, to] = [line.position_m[k - 1] as number, line.position_m[k] as number];
    foundM = from + share * (to - from);
  }
  return foundM;

  /** Offset from the point on a plane on which both directions have one scale. */
  function fromPoint([x, y]: Point): Point {
    return [(x - longitude) * shrink, y - latitude];
  }
}

/** Latitude and longitude as a person writes them; null for any other text. */
export function readCoordinates(text: string): Position | null {
  const match = /^\s*(-?\d{1,3}(?:\.\d+)?)\s*[,; ]\s*(-?\d{1,3}(?:\.\d+)?)\s*$/.exec(text);
  if (!match) return null;
  const [latitude, longitude] = [Number(match[1]), Number(match[2])];
  if (Math.abs(latitude) > 90 || Math.abs(longitude) > 180) return null;
  return { latitude_deg: latitude, longitude_deg: longitude };
}

const EARTH_M = 6_371_000;

export type Position = Pick<Place, "latitude_deg" | "longitude_deg">;

/** Distance of two places as the crow flies [m]. */
export function metresBetween(one: Position, other: Position): number {
  const radians = Math.PI / 180;
  const north = (other.latitude_deg - one.latitude_deg) * radians;
  const middle = ((one.latitude_deg + other.latitude_deg) / 2) * radians;
  const east = (other.longitude_deg - one.longitude_deg) * radians * Math.cos(middle);
  return EARTH_M * Math.hypot(north, east);
}
