import type { Journey, Road } from "../api/types";
import { PERCENT } from "../model/units";
import { journey } from "../state/journey";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";

const WIDTH = 640;
const HEIGHT = 300;
const MARGIN = 16;
const PIECES = 40;
const HIGH = 1.25;
const LOW = 0.75;

type Point = readonly [number, number];

/** Points of a road in the picture: north is up, and a kilometre has one length in both directions. */
function pointsOf({ line }: Road): Point[] {
  const north = line.latitude_deg;
  const middle = ((north[0] ?? 0) + (north.at(-1) ?? 0)) / 2;
  const shrink = Math.cos((middle * Math.PI) / 180);
  const east = line.longitude_deg.map((degrees) => degrees * shrink);
  const [west, south] = [Math.min(...east), Math.min(...north)];
  const span = Math.max(
    (Math.max(...east) - west) / (WIDTH - 2 * MARGIN),
    (Math.max(...north) - south) / (HEIGHT - 2 * MARGIN),
    1e-9,
  );
  const left = (WIDTH - (Math.max(...east) - west) / span) / 2;
  const below = (HEIGHT - (Math.max(...north) - south) / span) / 2;
  return east.map((x, k) => {
    const y = north[k] ?? south;
    return [left + (x - west) / span, HEIGHT - below - (y - south) / span] as const;
  });
}

function energyAt({ forecast, distance_m }: Road, position: number): number {
  const { distance_m: along, energy_wh: energy } = forecast.series;
  const end = along.at(-1) ?? 1;
  const wanted = (position / distance_m) * end;
  const k = Math.max(
    along.findIndex((x) => x >= wanted),
    1,
  );
  const [x0, x1] = [along[k - 1] ?? 0, along[k] ?? end];
  const [y0, y1] = [energy[k - 1] ?? 0, energy[k] ?? 0];
  return x1 > x0 ? y0 + ((wanted - x0) / (x1 - x0)) * (y1 - y0) : y1;
}

/** Pieces of a road by their consumption against that of the whole road. */
function piecesOf(road: Road): { path: string; level: "low" | "usual" | "high" }[] {
  const points = pointsOf(road);
  const mean = energyAt(road, road.distance_m) / road.distance_m;
  const step = Math.max(Math.floor(points.length / PIECES), 1);
  const pieces = [];
  for (let first = 0; first < points.length - 1; first += step) {
    const last = Math.min(first + step, points.length - 1);
    const [from, to] = [road.line.position_m[first] ?? 0, road.line.position_m[last] ?? 0];
    const ratio = to > from ? (energyAt(road, to) - energyAt(road, from)) / (to - from) / mean : 1;
    const level = ratio > HIGH ? "high" : ratio < LOW ? "low" : "usual";
    const path = points.slice(first, last + 1).map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`);
    pieces.push({ path: path.join(" "), level } as const);
  }
  return pieces;
}

function RoadPicture({ of }: { of: Journey }) {
  const [road] = of.roads;
  if (!road) return null;
  const words = text.value.journey;
  const points = pointsOf(road);
  const ends = [points[0], points.at(-1)] as const;
  const title = of.stops.map(({ name }) => name).join(" – ");
  return (
    <figure class="road-picture">
      <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={words.picture(title)}>
        {piecesOf(road).map(({ path, level }) => (
          <polyline key={path} points={path} class={`way ${level}`} />
        ))}
        {ends.map(
          (end, k) => end && <circle key={k} cx={end[0]} cy={end[1]} r={7} class={k ? "end" : "start"} />,
        )}
      </svg>
      <ul class="legend" aria-hidden="true">
        <li class="key-low">{words.low}</li>
        <li class="key-usual">{words.usual}</li>
        <li class="key-high">{words.high}</li>
      </ul>
      <p class="note">{of.attribution}</p>
    </figure>
  );
}

/** What a driver asks of a journey, and its road. */
export function JourneyAnswer() {
  const found = journey.value;
  if (!found || trip.value?.source !== "journey") return null;
  const { shown, span } = format.value;
  const words = text.value.journey;
  const { charging: stop, soc_needed: needed, motorway_speed_m_s: speed } = found;
  return (
    <div class="journey-answer">
      <p>
        {needed === null ? words.notEnough : words.leaveWith(shown(Math.ceil(needed * 100) / 100, PERCENT))}
      </p>
      {speed !== null && <p>{words.atMost(shown(speed, units.value.speed, 0))}</p>}
      {stop && (
        <p>
          {words.charge(
            stop.station.name || words.station,
            span(stop.charging_s),
            shown(stop.soc_arrival, PERCENT),
            shown(stop.soc_leave, PERCENT),
          )}
        </p>
      )}
      <RoadPicture of={found} />
    </div>
  );
}
