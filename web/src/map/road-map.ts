/** The map: MapLibre GL with roads of the service, the ends of a journey, its roads, the area of reach and stations.
 *
 * This module and its library are loaded when a map is first shown. It knows nothing of the state of the page.
 */

import type {
  CircleLayerSpecification,
  GeoJSONSource,
  LayerSpecification,
  Map as Canvas,
  MapMouseEvent,
  Marker,
  StyleSpecification,
  SymbolLayerSpecification,
} from "maplibre-gl";
import { groupsOf, type Lean, leansOf, numbersText, type Pixel, PIN_PX } from "../model/pins";
import type { Bounds, Field, Point } from "../model/road";

/** Name of the worker's file; the build fills it in. */
declare const MAP_WORKER: string;

/** A pin of the journey that can be dragged: one of its ends, or a place on the way. */
export interface Mark {
  field: Field;
  at: Point;
  /** What stands in it. */
  letter: string;
  label: string;
}

/** Names of the colours of the map in the style sheet. */
export const MAP_COLOURS = [
  "map-ground",
  "map-minor",
  "map-major",
  "map-motorway",
  "map-other",
  "text",
  "surface",
  "main",
  "low",
  "usual",
  "high",
  "station",
] as const;

export type MapPalette = Record<(typeof MAP_COLOURS)[number], string>;

export interface MapHandlers {
  onClick: (at: Point) => void;
  /** `done` is false while the pointer is down. */
  onDrag: (field: Field, to: Point, done: boolean) => void;
  /** The pointer is on the chosen road; null when it leaves. */
  onRoad: (at: Point | null) => void;
  onOther: (road: number) => void;
  /** A station is chosen, by its position; null for none. */
  onStation: (at: Point | null) => void;
  onView: (bounds: Bounds) => void;
}

/** MapLibre GL; a parameter, so that its code is a file of its own that changes with its version alone. */
export type Library = typeof import("maplibre-gl");

export interface MapOptions {
  library: Library;
  container: HTMLElement;
  palette: MapPalette;
  /** URL of the tiles with {z}, {x} and {y}; empty for a plain background. */
  tiles: string;
  /** Font of the labels. */
  font: string;
  headers: () => Record<string, string>;
  /** What is in view at first. */
  bounds: Bounds | null;
  label: string;
  handlers: MapHandlers;
}

export type Collection = GeoJSON.FeatureCollection;
export type Feature = GeoJSON.Feature;

const EMPTY: Collection = { type: "FeatureCollection", features: [] };
const TILE_ZOOM = { minzoom: 4, maxzoom: 14 };
/** Of what is fitted into view [px]: pins stand above their points, names reach to both sides, a pin has room beside the buttons at the right. */
const PADDING = { top: 64, right: 100, bottom: 36, left: 60 };
const MAX_FIT_ZOOM = 14;
/** Zoom of the whole world, where nothing else is known. */
const START_ZOOM = 3;

/** Values of `road_class` in Valhalla's tiles: 0 motorway, 1 trunk, 2 primary, 3 secondary, 4 tertiary, then minor ones. */
const MOTORWAY = 0;
const PRIMARY = 2;
const SECONDARY = 3;
const TERTIARY = 4;
const SERVICE = 7;

/** Room that names keep free [px]: of a pin beside its point, of a stop with its number, of a station. */
const ROOMS = { pin: [PIN_PX + 4, PIN_PX + 4], stop: [26, 26], station: [14, 14] } as const;

const BY_ZOOM = ["interpolate", ["linear"], ["zoom"]];

const DATA = ["roads", "others", "reach", "settlements", "stations", "stops", "pins", "dot"] as const;
type Data = (typeof DATA)[number];

const LAYERS_TO_CLICK = ["stop", "station", "road-hit", "other-hit"];

const WIDTHS = {
  minor: ["interpolate", ["exponential", 1.5], ["zoom"], 9, 0.5, 14, 2, 18, 10],
  secondary: ["interpolate", ["exponential", 1.5], ["zoom"], 7, 0.6, 12, 2, 18, 14],
  major: ["interpolate", ["exponential", 1.5], ["zoom"], 5, 0.8, 8, 1.4, 12, 2.8, 18, 16],
  motorway: ["interpolate", ["exponential", 1.5], ["zoom"], 4, 1, 8, 2.2, 12, 4, 18, 22],
} as const;

/** Layers of the roads of the map, from below. */
function roadLayers(palette: MapPalette): LayerSpecification[] {
  const layer = (kind: keyof typeof WIDTHS, lowest: number, highest: number): LayerSpecification => ({
    id: `map-${kind}`,
    type: "line",
    source: "tiles",
    "source-layer": "edges",
    filter: ["all", [">=", ["get", "road_class"], lowest], ["<=", ["get", "road_class"], highest]],
    layout: { "line-cap": "round", "line-join": "round" },
    paint: {
      "line-color": palette[`map-${kind === "secondary" ? "major" : kind}`],
      "line-width": WIDTHS[kind] as never,
    },
  });
  return [
    layer("minor", TERTIARY, SERVICE),
    layer("secondary", SECONDARY, SECONDARY),
    layer("major", MOTORWAY + 1, PRIMARY),
    layer("motorway", MOTORWAY, MOTORWAY),
  ];
}

function line(id: string, source: Data, paint: object): LayerSpecification {
  return { id, type: "line", source, layout: { "line-cap": "round", "line-join": "round" }, paint };
}

/** The size and the colours of a round mark. */
function circle(id: string, source: Data, paint: object): CircleLayerSpecification {
  return { id, type: "circle", source, paint: { "circle-stroke-width": 2, ...paint } };
}

/** Room that names keep free of a mark. */
function room(of: keyof typeof ROOMS, id: string, source: Data, more: object = {}): SymbolLayerSpecification {
  const layout = { "icon-image": `room-${of}`, "icon-allow-overlap": true, ...more };
  return { id, type: "symbol", source, layout };
}

/** Where a name stands beside its point, the best place first: close to it, or clear of a road through it. */
const BESIDE = [
  ...["left", [0.5, 0], "top", [0, 0.4], "right", [-0.5, 0], "bottom", [0, -0.4]],
  ...["top", [0, 0.9], "bottom", [0, -0.9], "top", [0, 1.6], "bottom", [0, -1.6]],
];
/** The name of a place with a pin: below the point, or above the pin; the map may end at its side. */
const BESIDE_PIN = ["top", [0, 0.9], "bottom", [0, -3.4], ...BESIDE];

/** Zoom from which settlements are shown: those of a whole country would cover its roads. */
const SHOWN_FROM_ZOOM = [">=", ["zoom"], ["match", ["get", "kind"], "city", 0, "town", 6, 9]];

/** Layers of the journey, from below. */
function journeyLayers(palette: MapPalette, font: string): LayerSpecification[] {
  const level = ["match", ["get", "level"], "low", palette.low, "high", palette.high, palette.usual];
  const width = ["match", ["get", "level"], "low", 3.5, "high", 7.5, 5.5]; // not by colour alone
  return [
    {
      id: "reach-area",
      type: "fill",
      source: "reach",
      paint: { "fill-color": palette.main, "fill-opacity": 0.14 },
    },
    line("reach-edge", "reach", {
      "line-color": palette.main,
      "line-width": 2,
      "line-dasharray": [
        "case",
        ["==", ["get", "probability"], 0.5],
        ["literal", [2, 2]],
        ["literal", [1, 0]],
      ],
    }),
    line("other-hit", "others", { "line-color": palette["map-other"], "line-width": 18, "line-opacity": 0 }),
    line("other", "others", { "line-color": palette["map-other"], "line-width": 4 }),
    line("road-casing", "roads", { "line-color": palette.surface, "line-width": 10.5 }),
    line("road", "roads", { "line-color": level, "line-width": width }),
    line("road-hit", "roads", { "line-color": palette.surface, "line-width": 22, "line-opacity": 0 }),
    {
      ...circle("settlement-dot", "settlements", {
        "circle-radius": ["match", ["get", "kind"], "city", 3.5, "town", 3, 2],
        "circle-color": palette.text,
        "circle-stroke-color": palette["map-ground"],
        "circle-stroke-width": 1,
      }),
      filter: SHOWN_FROM_ZOOM as never,
    },
    circle("station", "stations", {
      // small on the map of a country, where they would hide the road
      "circle-radius": [...BY_ZOOM, 6, 2, 9, ["match", ["get", "wish"], "preferred", 7, 5]],
      "circle-stroke-width": [...BY_ZOOM, 6, 0.5, 9, 2],
      "circle-color": ["match", ["get", "wish"], "avoided", palette.surface, palette.station],
      "circle-stroke-color": ["match", ["get", "wish"], "avoided", palette.station, palette.surface],
    }),
    circle("stop", "stops", {
      "circle-radius": ["case", [">", ["length", ["get", "order"]], 2], 16, 11],
      "circle-color": palette.station,
      "circle-stroke-color": palette.surface,
    }),
    {
      id: "settlement",
      type: "symbol",
      source: "settlements",
      filter: SHOWN_FROM_ZOOM as never,
      layout: {
        "text-field": ["get", "name"],
        "text-font": [font],
        "text-size": ["match", ["get", "kind"], "city", 17, "town", 15, 12.5],
        "text-variable-anchor-offset": [
          "case",
          ["get", "pinned"],
          ["literal", BESIDE_PIN],
          ["literal", BESIDE],
        ] as never,
        "text-justify": "auto",
        "symbol-sort-key": ["get", "rank"],
        "text-padding": 4,
      },
      paint: { "text-color": palette.text, "text-halo-color": palette["map-ground"], "text-halo-width": 1.6 },
    },
    // What is above is placed first: names keep clear of the road, of stations, of stops and of the pins.
    room("station", "road-room", "roads", {
      "symbol-placement": "line",
      "symbol-spacing": ROOMS.station[0],
      "icon-padding": 0,
    }),
    room("station", "station-room", "stations"),
    {
      ...room("stop", "stop-room", "stops", {
        "text-field": ["get", "order"],
        "text-font": [font],
        "text-size": 14,
        "text-allow-overlap": true,
      }),
      paint: { "text-color": palette.surface },
    },
    room("pin", "pin-room", "pins", { "icon-anchor": ["get", "anchor"], "icon-padding": 0 }),
    circle("dot", "dot", {
      "circle-radius": 7,
      "circle-color": palette.text,
      "circle-stroke-color": palette.surface,
      "circle-stroke-width": 3,
    }),
  ];
}

function styleOf({ palette, tiles, font }: MapOptions): StyleSpecification {
  return {
    version: 8,
    sources: {
      ...(tiles && { tiles: { type: "vector", tiles: [tiles], ...TILE_ZOOM } }),
      ...Object.fromEntries(DATA.map((name) => [name, { type: "geojson", data: EMPTY }])),
    },
    layers: [
      { id: "ground", type: "background", paint: { "background-color": palette["map-ground"] } },
      ...(tiles ? roadLayers(palette) : []),
      ...journeyLayers(palette, font),
    ],
  };
}

function pointOf({ lngLat }: { lngLat: { lng: number; lat: number } }): Point {
  return [lngLat.lng, lngLat.lat];
}

function pointFeature(coordinates: Point, properties: GeoJSON.GeoJsonProperties): Feature {
  // eslint-disable-next-line page/text -- types of GeoJSON
  return { type: "Feature", geometry: { type: "Point", coordinates }, properties };
}

/** The corner of a pin that is its tip. */
function anchorOf([right, down]: Lean): string {
  return `${down > 0 ? "top" : "bottom"}-${right > 0 ? "left" : "right"}`;
}

export class RoadMap {
  private readonly map: Canvas;
  private readonly markers = new Map<Field, Marker>();
  private readonly waiting = new Map<Data, Collection>();
  private stops: readonly Point[] = [];
  private loaded = false;

  constructor(private readonly options: MapOptions) {
    const { library, container, bounds, headers } = options;
    library.setWorkerUrl(new URL(MAP_WORKER, import.meta.url).href);

    this.map = new library.Map({
      container,
      style: styleOf(options),
      attributionControl: false,
      dragRotate: false,
      maxPitch: 0,
      zoom: START_ZOOM,
      ...(bounds && {
        bounds: [bounds[1], bounds[0], bounds[3], bounds[2]], // west first
        fitBoundsOptions: { padding: 28 },
      }),
      transformRequest: (url) => ({ url, headers: headers() }),
      fadeDuration: 0,
    });
    this.map.touchZoomRotate.disableRotation();
    this.map.getCanvas().setAttribute("aria-label", options.label);
    this.listen();
  }

  /** Put pins on the places of the journey, and on no others. */
  setMarks(marks: readonly Mark[]): void {
    for (const [field, known] of this.markers) {
      if (marks.some((mark) => mark.field === field)) continue;
      known.remove();
      this.markers.delete(field);
    }
    for (const mark of marks) {
      const known = this.markers.get(mark.field);
      const marker = known ?? this.marker(mark);
      marker.setLngLat(mark.at).getElement().setAttribute("aria-label", mark.label);
      if (!known) this.markers.set(mark.field, marker.addTo(this.map)); // adding it again would end a drag
    }
    this.place();
  }

  /** Charging stops of the plan in their order. */
  setStops(stops: readonly Point[]): void {
    this.stops = stops;
    this.place();
  }

  /** Keep pins, stops and names off each other: stops share a mark, pins lean to where there is room. */
  private place(): void {
    const pixelOf = (at: Point): Pixel => {
      const { x, y } = this.map.project(at);
      return [x, y];
    };
    const stops = this.stops.map(pixelOf);
    this.setData(
      "stops",
      groupsOf(stops).map((group) => {
        const order = numbersText(group.map((k) => k + 1));
        return pointFeature(this.stops[group[0] ?? 0] as Point, { order });
      }),
    );
    const markers = [...this.markers.values()];
    const places = markers.map((marker) => pointOf({ lngLat: marker.getLngLat() }));
    const leans = leansOf(places.map(pixelOf), stops);
    for (const [k, marker] of markers.entries()) {
      const [right, down] = leans[k] as Lean;
      marker.setOffset([(right * PIN_PX) / 2, (down * PIN_PX) / 2]);
      const element = marker.getElement();
      const tip = anchorOf([right, down]);
      element.dataset.lean = tip;
      element.style.borderRadius = "50%";
      element.style.setProperty(`border-${tip}-radius`, "4px");
    }
    this.setData(
      "pins",
      places.map((at, k) => pointFeature(at, { anchor: anchorOf(leans[k] as Lean) })),
    );
  }

  setData(source: Data, features: Feature[]): void {
    const collection: Collection = { type: "FeatureCollection", features };
    if (this.loaded) void this.map.getSource<GeoJSONSource>(source)?.setData(collection);
    else this.waiting.set(source, collection);
  }

  /** Bring points into view. */
  fit(points: readonly Point[]): void {
    const bounds = new this.options.library.LngLatBounds();
    for (const point of points) bounds.extend(point);
    this.map.fitBounds(bounds, { padding: PADDING, maxZoom: MAX_FIT_ZOOM, duration: 500 });
  }

  zoom(by: 1 | -1): void {
    if (by > 0) this.map.zoomIn();
    else this.map.zoomOut();
  }

  /** The part of the world that is in view, without its copies to the left and right. */
  bounds(): Bounds {
    const box = this.map.getBounds();
    return [box.getSouth(), Math.max(box.getWest(), -180), box.getNorth(), Math.min(box.getEast(), 180)];
  }

  remove(): void {
    this.map.remove();
  }

  private marker({ field, letter }: Mark): Marker {
    const element = document.createElement("div");
    // eslint-disable-next-line page/text -- classes
    element.className = `end-mark end-${field.replace(/\d+/, "")}`;
    element.textContent = letter;
    element.setAttribute("role", "img");
    const marker = new this.options.library.Marker({ element, draggable: true, anchor: "center" });
    const tell = (done: boolean) => {
      const { lng, lat } = marker.getLngLat();
      this.options.handlers.onDrag(field, [lng, lat], done);
      if (done) this.place();
    };
    marker.on("drag", () => tell(false));
    marker.on("dragend", () => tell(true));
    return marker;
  }

  private listen(): void {
    const { map } = this;
    const { handlers } = this.options;
    map.on("style.load", () => {
      for (const [name, [width, height]] of Object.entries(ROOMS)) {
        map.addImage(`room-${name}`, { width, height, data: new Uint8Array(4 * width * height) });
      }
    });
    map.on("load", () => {
      this.loaded = true;
      for (const [source, collection] of this.waiting) this.setData(source, collection.features);
      this.waiting.clear();
      map.getContainer().dataset.ready = "true";
      handlers.onView(this.bounds());
    });
    map.on("moveend", () => handlers.onView(this.bounds()));
    map.on("zoom", () => this.place());
    map.on("click", (event) => this.click(event));
    map.on("mousemove", "road-hit", (event) => handlers.onRoad(pointOf(event)));
    map.on("mouseleave", "road-hit", () => handlers.onRoad(null));
    map.on("mouseenter", LAYERS_TO_CLICK, () => void (map.getCanvas().style.cursor = "pointer"));
    map.on("mouseleave", LAYERS_TO_CLICK, () => void (map.getCanvas().style.cursor = ""));
  }

  /** A click belongs to what is on top: a station, the chosen road, another road, else the ground. */
  private click(event: MapMouseEvent): void {
    const { handlers } = this.options;
    const hit = this.map.queryRenderedFeatures(event.point, { layers: LAYERS_TO_CLICK });
    const on = (layer: string) => hit.find((feature) => feature.layer.id === layer);
    const station = on("stop") ?? on("station");
    const other = on("other-hit");
    handlers.onStation(station ? ((station.geometry as GeoJSON.Point).coordinates as Point) : null);
    if (station) return;
    if (on("road-hit")) handlers.onRoad(pointOf(event));
    else if (other) handlers.onOther(Number(other.properties.road));
    else handlers.onClick(pointOf(event));
  }
}
