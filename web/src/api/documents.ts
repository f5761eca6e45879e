/** Documents of the service by the names that the page has for them; `types.ts` comes from its OpenAPI document. */

import type { ChargingDocument, ForecastRequest, ProblemDocument, RoadDocument } from "../../generated/types";

/** Those that have a name of their own in the page; the others keep theirs. */
export type * from "../../generated/types";
export type {
  ActionDocument as AdvisedAction,
  AdvisedDocument as Advised,
  AdviceResponse as Advice,
  DifferenceDocument as Difference,
  JourneyInShort as Whole,
  SpeedCapDocument as SpeedCap,
  ChargingDocument as ChargingPlan,
  ChargingStop as Stop,
  CourseDocument as Course,
  NeedResponse as Need,
  KindRange as RangeOfKind,
  PlanRequest as JourneyRequest,
  PlanResponse as Journey,
  RangeResponse as Range,
  Group as Alike,
  CarResponse as OwnCar,
  CarSummary as OwnCarSummary,
  ExampleResponse as Example,
  FlagDocument as Flag,
  FileDocument as FileReading,
  ForecastResponse as Forecast,
  KindDocument as KindReading,
  LiveCarDocument as RoadCar,
  LiveForecastDocument as LiveForecast,
  LiveResponse as LiveCar,
  LogsResponse as LogsReading,
  MapResponse as MapInfo,
  ModelSummary as Model,
  PlaceDocument as Place,
  ProblemFault as Fault,
  ReachResponse as Reach,
  RouteResponse as Route,
  VehicleFigures as Figures,
  VehicleSummary as Vehicle,
  ViewResponse as MapView,
} from "../../generated/types";

/** A road; the stops of its plan are not there if the service does not give them. */
export type Road = RoadDocument & { charging?: ChargingDocument | null };

/** A problem of the service, or one that the page itself found. */
export type Problem = Omit<ProblemDocument, "type"> & {
  type: ProblemDocument["type"] | "unreachable" | "failed" | "page";
};
export type Column = (number | null)[];
export type Columns = Record<string, Column>;
export type Samples = NonNullable<ForecastRequest["samples"]>;
