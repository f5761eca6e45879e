/** Documents of the service; the names are those of `docs/service.md`. */

export type Column = (number | null)[];
export type Columns = Record<string, Column>;

export interface Link {
  length_m: number;
  speed_m_s?: number;
  travel_time_s?: number;
  stop_s?: number;
  moving_speed_m_s?: number;
  speed_limit_m_s?: number;
  [more: string]: number | undefined;
}

export interface Series {
  time_s: number[];
  distance_m: number[];
  energy_wh: number[];
  energy_low_wh: number[];
  energy_high_wh: number[];
  displayed_soc: number[];
  displayed_soc_low: number[];
  displayed_soc_high: number[];
}

/** An assumption, or a value outside the range of the training trips. */
export interface Flag {
  code: string;
  /** Field or component that the flag concerns. */
  subject: string;
  value: number | string | null;
  unit: string;
  /** The flag as an English sentence. */
  message: string;
}

/** The charge to leave with: above 1 where a full battery does not suffice, 0 where any charge does. */
export interface LeaveWith {
  soc_needed: number;
  reserve: number;
  probability: number;
}

export interface Forecast {
  trip: string;
  given: string;
  energy_wh: number;
  quantiles_wh: Record<string, number>;
  soc_arrival: number;
  soc_quantiles: Record<string, number>;
  /** Distance at which the display reaches 0 [m]; null where it does not on this trip. */
  empty_at_m: { early: number | null; expected: number | null; late: number | null };
  /** Energy that the trip takes beyond what the battery holds [Wh]. */
  missing_wh: { least: number; expected: number; most: number };
  /** Energy of a whole display [Wh]. */
  wh_per_display: number;
  p_arrive: Record<string, number>;
  /** What the climb of a road of unknown heights changes; null where the heights are known. */
  climb: UnknownClimb | null;
  /** Null where the request has no probability. */
  leave_with: LeaveWith | null;
  series: Series;
  by_cause_wh: Record<string, number>;
  battery_loss_wh: number;
  measured_until_s: number;
  flags: Flag[];
}

export interface Fault {
  what: string;
  where: string;
  got: string;
  allowed: string;
  fix: string;
}

/** A problem document; `type` is the path `/problems/KIND`. */
export interface Problem {
  type?: string;
  title: string;
  status: number;
  detail: string;
  faults?: Fault[];
}

export interface Model {
  name: string;
  model: { vehicle: string; vehicle_title: string; trips: number };
}

export interface Vehicle {
  name: string;
  title: string;
  /** Models fitted on trips of this car. */
  models: string[];
}

/** A car that the service does not have, by up to six figures. */
export interface Figures {
  mass_kg?: number;
  usable_battery_kwh?: number;
  consumption_kwh_per_100km?: number;
  motor_power_kw?: number;
  body: "small" | "hatchback" | "sedan" | "estate" | "suv" | "van" | "pickup";
  heat_pump: boolean;
  procedure: "wltp" | "epa";
}

/** What such a car would be certified with. */
export interface DescribedVehicle {
  wltp_kwh_per_100km: number;
  wltp_low_kwh_per_100km: number;
  wltp_high_kwh_per_100km: number;
}

export interface ExampleSummary {
  trip: string;
  title: string;
  vehicle: string;
  note: string;
  duration_s: number;
  distance_m: number;
  ambient_temperature_degc: number | null;
}

export interface Example extends ExampleSummary {
  request: { samples: Columns } & Record<string, unknown>;
  observed: Columns;
}

export interface Place {
  name: string;
  kind: string;
  latitude_deg: number;
  longitude_deg: number;
}

/** What the service knows of roads and places. */
export interface MapInfo {
  roads: boolean;
  places: boolean;
  /** Whether the service has the roads of the map as vector tiles. */
  tiles: boolean;
  stations: number;
  /** South, west, north and east. */
  bounds_deg: [number, number, number, number] | null;
  attribution: string;
}

/** What is named in a part of the map. */
export interface MapView {
  settlements: Place[];
  stations: Station[];
}

/** The area that is reached with a probability. */
export interface ReachArea {
  probability: number;
  polygon: { type: "Polygon"; coordinates: [number, number][][] };
}

export interface Reach {
  areas: ReachArea[];
  map_ends: boolean;
}

export interface Station {
  name: string;
  power_w: number;
  latitude_deg: number;
  longitude_deg: number;
}

export interface Charging {
  station: Station;
  soc_arrival: number;
  soc_leave: number;
  charging_s: number;
  p_station: number;
  p_arrive: number;
}

/** Country of a road whose heights are unknown. */
export type Terrain = "unknown" | "flat" | "hilly" | "mountains";

export interface UnknownClimb {
  terrain: Terrain;
  /** Displayed charge that each metre of climb takes. */
  soc_per_m: number;
  /** By charge on arrival: climb with which the expected arrival falls to it [m]; null where no such road climbs so far. */
  changes_at_m: Record<string, number | null>;
}

export interface Road {
  /** Of "fastest", "shortest", "least energy". */
  labels: string[];
  distance_m: number;
  duration_s: number;
  line: { latitude_deg: number[]; longitude_deg: number[]; position_m: number[] };
  samples: Columns;
  forecast: Forecast;
}

export interface Journey {
  stops: Place[];
  arrives: boolean;
  /** Above 1 where a full battery does not suffice, 0 where any charge does. */
  soc_needed: number;
  motorway_speed_m_s: number | null;
  charging: Charging | null;
  roads: Road[];
  flags: Flag[];
  attribution: string;
}

export interface Route {
  samples: Columns;
  links?: Link[] | null;
  /** Elevation along the links. */
  elevation?: { position_m: number[]; elevation_m: number[] } | null;
  duration_s: number;
  distance_m: number;
  notes: Flag[];
}

/** A car that the service keeps. */
export interface OwnCarSummary {
  name: string;
  vehicle: string;
  title: string;
  /** Logs in its store. */
  trips: number;
  in_diary: number;
  has_token: boolean;
}

/** Forecasts beside what the trips took; shares of the energy, null for what no trip shows. */
export interface Score {
  trips: number;
  error: number | null;
  weighted_error: number | null;
  bias: number | null;
  coverage: number | null;
  width: number | null;
  /** Trips within their 90 % interval. */
  inside: number;
  /** Width with which the intervals would have held exactly 90 % of these trips. */
  needed_width: number | null;
}

export interface DiaryEntry {
  trip_id: string;
  started_at: string;
  trips_learned: number;
  distance_m: number;
  duration_s: number;
  ambient_temperature_degc: number | null;
  energy_wh: number;
  forecast_wh: number;
  low_wh: number;
  high_wh: number;
  by_cause_wh: Record<string, number>;
  /** Forecasts of the whole trip that were made on the way; the first may be that of the departure. */
  on_the_way: OnTheWay[];
}

export interface OnTheWay {
  /** Since the start of the trip. */
  at_s: number;
  distance_m: number;
  energy_wh: number;
  low_wh: number;
  high_wh: number;
}

export interface Season {
  trips: number;
  distance_m: number;
  energy_wh: number;
  error: number | null;
  coverage: number | null;
}

export interface Learning {
  state: "running" | "done" | "failed";
  done: number;
  total: number | null;
  added: number | null;
  known: number | null;
  entries: number | null;
  left_out: string[];
  faults: Fault[];
}

export interface OwnCar extends OwnCarSummary {
  /** Relative changes of physical parameters. */
  learned: Record<string, { change: number; sd: number }>;
  score: Score;
  latest: Score;
  latest_by_book: Score;
  by_season: Record<string, Season>;
  by_cause_wh: Record<string, number>;
  /** Newest first. */
  diary: DiaryEntry[];
  base_load_w: number;
  learning: Learning | null;
}

export interface LogsChanges {
  changes?: Record<string, { column: string; unit?: string } | null>;
  current_positive?: "discharge" | "charge";
}

/** How the tables of an upload are read, and what they hold then. */
export interface LogsReading {
  columns: string[];
  fields: { ours: string; units: string[] }[];
  mapping: { ours: string; column: string; unit: string; why: string }[];
  shipped: string | null;
  unused: string[];
  current_positive: "discharge" | "charge";
  assumed: Record<string, number>;
  preview: {
    logs: number;
    drives: number;
    distance_m: number;
    energy_wh: number;
    findings: { trip: string; from_s: number; to_s: number; what: string; consequence: string }[];
    n_findings: number;
  } | null;
  faults: Fault[];
}

/** A car that can send messages. */
export interface RoadCar {
  vehicle: string;
  seconds_since_message: number | null;
  on_trip: boolean;
}

/** The forecast of a trip on the road; quantiles at 0.05, 0.5 and 0.95. */
export interface LiveForecast {
  energy_wh: number;
  quantiles_wh: Record<string, number>;
  soc_arrival: number;
  soc_quantiles: Record<string, number>;
  reserve: number;
  p_arrive: number;
  /** Before the battery is empty. */
  p_arrive_at_all: number;
  /** Length of the whole trip. */
  distance_m: number;
}

/** A car on the road. */
export interface LiveCar {
  vehicle: string;
  seconds_since_message: number | null;
  soc: number | null;
  trip: { duration_s: number; distance_m: number } | null;
  plan: "given" | "usual" | null;
  forecast: LiveForecast | null;
  faults: Fault[];
}
