/** Documents of the service by the names that the page has for them; `types.ts` comes from its OpenAPI document. */

import type {
  FlagDocument as Flag,
  ForecastRequest,
  PlanRequest,
  PlanResponse,
  StationDocument,
} from "./types";

export type {
  AlikeDocument as Alike,
  CarResponse as OwnCar,
  CarSummary as OwnCarSummary,
  DescribedVehicle,
  DiaryEntry,
  ExampleResponse as Example,
  ExampleSummary,
  FlagDocument as Flag,
  ForecastRequest,
  FileDocument as FileReading,
  ForecastResponse as Forecast,
  KindChanges,
  KindDocument as KindReading,
  LeaveWith,
  Link,
  LiveCarSummary as RoadCar,
  LiveForecastDocument as LiveForecast,
  LivePlanRequest,
  LiveResponse as LiveCar,
  LogsRequest,
  LogsResponse as LogsReading,
  MapResponse as MapInfo,
  ModelSummary as Model,
  NewCarRequest,
  PlaceDocument as Place,
  ProblemDocument as Problem,
  ProblemFault as Fault,
  ReachRequest,
  ReachResponse as Reach,
  RoadDocument as Road,
  RouteResponse as Route,
  ScoreDocument as Score,
  Series,
  StationDocument as Station,
  VehicleFigures as Figures,
  VehicleSummary as Vehicle,
  ViewResponse as MapView,
} from "./types";

export type Column = (number | null)[];
export type Columns = Record<string, Column>;
export type Samples = NonNullable<ForecastRequest["samples"]>;
export type Terrain = NonNullable<ForecastRequest["terrain"]>;
export type ClimateMode = NonNullable<ForecastRequest["climate"]>;

export interface JourneyRequest extends PlanRequest {
  preheat_battery?: boolean;
}

export interface Stop {
  station: StationDocument;
  position_m: number;
  soc_arrival: number;
  soc_interval: number[];
  soc_leave: number;
  energy_wh: number;
  charging_s: number;
  overhead_s: number;
  arrives_after_s: number;
  p_reach: number;
  preheat: boolean;
  if_full: { station: StationDocument; soc_arrival: number; p_reach: number; more_s: number } | null;
}

export interface Course {
  position_m: number[];
  time_s: number[];
  displayed_soc: number[];
  low: number[];
  high: number[];
}

export interface ChargingPlan {
  label: string;
  stops: Stop[];
  p_arrive: number;
  p_reserve: number;
  soc_arrival: number;
  soc_interval: number[];
  driving_s: number;
  charging_s: number;
  duration_s: number;
  energy_wh: number;
  course: Course;
  line: { latitude_deg: number[]; longitude_deg: number[]; position_m: number[] };
}

export interface VerdictDocument {
  arrives: boolean;
  p_arrive: number;
  p_reserve: number;
  soc_arrival: number;
  soc_interval: number[];
  driving_s: number;
  charging_s: number;
  duration_s: number;
  departs_at: string | null;
  arrives_at: string | null;
  energy_wh: number;
  charges: number;
  advice: string;
}

export interface Journey extends Omit<PlanResponse, "charging" | "charging_alternatives" | "verdict"> {
  verdict: VerdictDocument;
  charging: ChargingPlan | null;
  charging_alternatives: ChargingPlan[];
}

export interface Need {
  distance_m: number;
  kind: string;
  energy_wh: number;
  energy_quantile_wh: number;
  quantile: number;
  interval_wh: number[];
  soc_needed: number;
  duration_s: number;
  flags: Flag[];
}

export interface RangeOfKind {
  kind: string;
  range_m: number;
  interval_m: number[];
}

export interface Range {
  range_m: number;
  interval_m: number[];
  by_kind: RangeOfKind[];
  flags: Flag[];
}
