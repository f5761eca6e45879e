import { type Signal, untracked, useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { tilesUrl, tokenHeaders, viewMap } from "../api/client";
import type { Journey, MapView, Place, Road, Station } from "../api/documents";
import { Latest } from "../api/latest";
import { coloursOf } from "../charts/palette";
import type { Feature, Mark, RoadMap } from "../map/road-map";
import {
  type Bounds,
  distanceNear,
  type Field,
  metresBetween,
  piecesOf,
  piecesOfPlan,
  type Point,
  pointAlong,
  pointAt,
  pointsOf,
  readCoordinates,
} from "../model/road";
import { fits, isPreferred, isSame, STATION_KIND, type StationChoice } from "../model/stations";
import { beginAt, move, source } from "../state/catalogue";
import { chargingPlan } from "../state/charging";
import { chooseRoad } from "../state/forecast";
import {
  answersAreOld,
  choice,
  chosenRoad,
  ends,
  fieldsOfJourney,
  isExample,
  isFindingReach,
  journey,
  map,
  nextEnd,
  placeAt,
  placeOf,
  wantsFit,
  wantsReachFit,
  reach,
  roadPoints,
  wantsReach,
} from "../state/journey";
import { positionM, selectedM } from "../state/position";
import { dark, text } from "../state/preferences";
import { trip } from "../state/trip";
import { Button, into, put, Tick } from "./parts";
import { StationList, StationPanel, Wishes } from "./station-panel";

const MIN_INTERVAL_MS = 150;
// eslint-disable-next-line page/text -- a font
const FONT = "Inter Variable";

function feature(geometry: GeoJSON.Geometry, properties: GeoJSON.GeoJsonProperties = {}): Feature {
  // eslint-disable-next-line page/text -- types of GeoJSON
  return { type: "Feature", geometry, properties };
}

function lineOf(coordinates: Point[], properties?: GeoJSON.GeoJsonProperties): Feature {
  return feature({ type: "LineString", coordinates }, properties);
}

function pointOf(coordinates: Point, properties?: GeoJSON.GeoJsonProperties): Feature {
  // eslint-disable-next-line page/text -- types of GeoJSON
  return feature({ type: "Point", coordinates }, properties);
}

function chosenOf(of: Journey | null): Road | null {
  return of?.roads[chosenRoad.value] ?? of?.roads[0] ?? null;
}

/** Charging stations beside those of the plan, with what the driver wants of them. */
function stationFeatures(
  known: readonly Station[],
  stops: readonly Station[],
  { avoid, networks }: StationChoice,
): Feature[] {
  return known
    .filter((station) => !stops.some((stop) => isSame(stop, station)))
    .map((station) => {
      const isAvoided = avoid.some((one) => isSame(one, station));
      const isWanted = networks.length > 0 && isPreferred(station.name, networks);
      const wish = isAvoided ? "avoided" : isWanted ? "preferred" : "";
      return pointOf([station.longitude_deg, station.latitude_deg], { wish });
    });
}

/** Where a place is on the map: one without a name is on its road. */
function placed(field: Field, place: Place): Point {
  const onRoad = roadPoints.value?.[fieldsOfJourney().indexOf(field)];
  return onRoad && readCoordinates(place.name) ? onRoad : [place.longitude_deg, place.latitude_deg];
}

/** The pin of a place of the journey: A and B, and V1 and so on between them. */
function markOf(field: Field): Mark[] {
  const place = placeOf(field);
  if (!place) return [];
  const stops = chargingPlan.value?.stops ?? [];
  if (place.kind === STATION_KIND && stops.some(({ station }) => isSame(station, place))) return []; // its number is there
  const { journey: words } = text.value;
  const isEnd = field === "from" || field === "to";
  const number = isEnd ? 0 : Number(field.slice(3)) + 1;
  const name = isEnd ? words[field] : words.via(number);
  const letter = isEnd ? (field === "from" ? "A" : "B") : `${name.charAt(0)}${number}`;
  return [{ field, letter, at: placed(field, place), label: `${name}: ${place.name}` }];
}

/** Of the journey on the page; null where another trip is shown. */
function shownJourney(): Journey | null {
  return trip.value?.stops ? journey.value : null;
}

/** The canvas of the map, made anew when the theme changes. */
function MapCanvas({
  view,
  onFail,
  onStation,
}: {
  view: Signal<MapView | null>;
  onFail: () => void;
  onStation: (at: Point | null) => void;
}) {
  const box = useRef<HTMLDivElement>(null);
  const made = useSignal<RoadMap | null>(null);
  const seen = useRef<Station[]>([]);
  useEffect(() => {
    let isGone = false;
    let created: RoadMap | null = null;
    const looks = new Latest<Bounds>(async (bounds, signal) => {
      try {
        view.value = await viewMap(bounds, signal);
      } catch {
        return; // names are an addition: the map is complete without them
      }
    }, MIN_INTERVAL_MS);
    void Promise.all([import("../map/road-map"), import("maplibre-gl")])
      .then(([{ MAP_COLOURS, RoadMap: Made }, library]) => {
        const container = box.current;
        if (isGone || !container) return;
        created = new Made({
          library,
          container,
          palette: coloursOf(container, MAP_COLOURS),
          tiles: map.value?.tiles ? tilesUrl() : "",
          font: FONT,
          headers: tokenHeaders,
          bounds: (map.value?.bounds_deg ?? null) as Bounds | null,
          label: text.value.map.label,
          handlers: {
            onClick: ([longitude, latitude]) => {
              if (isExample.value) beginAt(placeAt(longitude, latitude));
              else if (nextEnd.value) move(nextEnd.value, placeAt(longitude, latitude));
            },
            onDrag: (field, [longitude, latitude], done) => move(field, placeAt(longitude, latitude), !done),
            onRoad: (at) => {
              const road = chosenOf(shownJourney());
              selectedM.value = at && road ? distanceNear(road, at) : null;
            },
            onOther: chooseRoad,
            onStation,
            onView: (bounds) => looks.submit(bounds),
          },
        });
        made.value = created;
      })
      .catch(onFail);
    return () => {
      isGone = true;
      looks.cancel();
      created?.remove();
      made.value = null;
    };
  }, []);

  useSignalEffect(() => {
    made.value?.setMarks(fieldsOfJourney().flatMap(markOf));
  });
  useSignalEffect(() => {
    const now = shownJourney();
    const road = chosenOf(now);
    const plan = chargingPlan.value;
    const shown = plan ? piecesOfPlan(plan) : road ? piecesOf(road) : [];
    made.value?.setData(
      "roads",
      shown.map(({ level, line }) => lineOf(line, { level })),
    );
    const others = (now?.roads ?? []).map((other, k) => lineOf(pointsOf(other), { road: k }));
    made.value?.setData("others", plan ? [] : others.filter((_, k) => now?.roads[k] !== road));
  });
  useSignalEffect(() => {
    const road = chosenOf(shownJourney());
    const at = positionM.value;
    const plan = chargingPlan.value;
    const point = plan ? pointAlong(plan.line, at ?? 0) : road && pointAt(road, at ?? 0);
    made.value?.setData("dot", point && at !== null ? [pointOf(point)] : []);
  });
  useSignalEffect(() => {
    const areas = reach.value?.areas ?? [];
    made.value?.setData(
      "reach",
      areas.map(({ polygon, probability }) => feature(polygon, { probability })),
    );
  });
  useSignalEffect(() => {
    const settlements = view.value?.settlements ?? [];
    const pins = untracked(() => fieldsOfJourney().map(placeOf)); // names do not follow a pin that is dragged
    made.value?.setData(
      "settlements",
      settlements.map((one, rank) => {
        const pinned = pins.some((pin) => pin && isSame(pin, one));
        return pointOf([one.longitude_deg, one.latitude_deg], { ...one, rank, pinned });
      }),
    );
  });
  useSignalEffect(() => {
    const stops = (chargingPlan.value?.stops ?? []).map(({ station }) => station);
    made.value?.setStops(stops.map(({ longitude_deg, latitude_deg }) => [longitude_deg, latitude_deg]));
    made.value?.setData("stations", stationFeatures(knownStations(view.value), stops, choice.value));
    const isNew = (stop: Station) => !seen.current.some((one) => isSame(one, stop));
    if (stops.some(isNew)) wantsFit.value = true; // they may be out of view
    seen.current = stops;
  });
  useSignalEffect(() => {
    const now = shownJourney();
    if (!now || !made.value || !wantsFit.value) return;
    const plans = chargingPlan.value ? [chargingPlan.value] : now.roads;
    made.value.fit(plans.flatMap(pointsOf));
    wantsFit.value = answersAreOld.value; // its charging stops may lie beside the road
  });
  useSignalEffect(() => {
    const points = (reach.value?.areas ?? []).flatMap(({ polygon }) => polygon.coordinates.flat());
    if (points.length === 0 || !made.value || !wantsReachFit.value) return;
    made.value.fit(points as Point[]);
    wantsReachFit.value = false;
  });

  const { map: words } = text.value;
  return (
    <div class="map-box">
      <div ref={box} class="map-canvas" />
      <div class="map-tools">
        <Button aria-label={words.zoomIn} onClick={() => made.value?.zoom(1)} label="+" />
        <Button aria-label={words.zoomOut} onClick={() => made.value?.zoom(-1)} label="−" />
      </div>
      <p class="map-credit">{map.value?.attribution}</p>
    </div>
  );
}

/** Stations of the plan, and those in view that the car can use, each once. */
function knownStations(view: MapView | null): Station[] {
  const stops = (chargingPlan.value?.stops ?? []).map(({ station }) => station);
  const usable = (view?.stations ?? []).filter((one) => fits(one, journey.value?.plugs ?? []));
  const all = [...stops, ...usable];
  return all.filter((one, k) => all.findIndex((other) => isSame(one, other)) === k);
}

function hint(): string {
  const { map: words } = text.value;
  if (isExample.value) return words.replaceExample;
  if (nextEnd.value) return nextEnd.value === "from" ? words.clickFrom : words.clickTo;
  return words.drag;
}

function Legend() {
  const { map: words, journey: others } = text.value;
  const { avoid, networks } = choice.value;
  const isJourney = shownJourney() !== null;
  const hasOthers = !chargingPlan.value && (journey.value?.roads.length ?? 0) > 1;
  const keys: [boolean, string, string][] = [
    [isJourney, "key-low", others.low],
    [isJourney, "key-usual", others.usual],
    [isJourney, "key-high", others.high],
    [isJourney && hasOthers, "key-road", words.otherRoad],
    [chargingPlan.value !== null, "key-stop", words.stop],
    [!!map.value?.stations, "key-station", words.station],
    [networks.length > 0, "key-preferred", words.preferredStation],
    [avoid.length > 0, "key-avoided", words.avoidedStation],
  ];
  return (
    <ul class="legend" aria-hidden="true">
      {keys
        .filter(([isThere]) => isThere)
        .map(([, kind, name]) => (
          <li key={kind} class={kind}>
            {name}
          </li>
        ))}
    </ul>
  );
}

/** The map of a service with roads. It is an addition: From and To, the roads and the charge along the way work without. */
export function MapCard() {
  const view = useSignal<MapView | null>(null);
  const station = useSignal<Station | null>(null);
  const hasFailed = useSignal(false);
  const { map: words } = text.value;
  if (!map.value || source.value !== "journey") return null;
  const known = knownStations(view.value);
  const pick = (at: Point | null) => {
    if (!at) return void (station.value = null);
    const [longitude_deg, latitude_deg] = at;
    const far = (one: Station) => metresBetween(one, { latitude_deg, longitude_deg });
    const byDistance = knownStations(view.peek()).sort((one, other) => far(one) - far(other));
    station.value = byDistance[0] ?? null;
  };
  return (
    <section class="card map" aria-labelledby="map-title">
      <h2 id="map-title" class="unseen">
        {words.title}
      </h2>
      {hasFailed.value ? (
        <p class="note">{words.failed}</p>
      ) : (
        <MapCanvas key={String(dark.value)} view={view} onFail={put(hasFailed, true)} onStation={pick} />
      )}
      <div class="map-foot">
        {station.value ? <StationPanel of={station.value} known={known} /> : <p class="note">{hint()}</p>}
        <Wishes />
        {known.length > 0 && <StationList known={known} chosen={station.value} onChoose={into(station)} />}
        <Tick
          label={isFindingReach.value ? words.reachRunning : words.reach}
          checked={wantsReach.value}
          disabled={!ends.value.from}
          onChange={(checked) => {
            wantsReach.value = wantsReachFit.value = checked;
          }}
        />
        {reach.value && (
          <p class="note">
            {words.reachKey}
            {reach.value.map_ends && ` ${words.mapEnds}`}
          </p>
        )}
        <Legend />
      </div>
    </section>
  );
}
