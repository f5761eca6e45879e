/** The settings of a trip that a slider changes: quantity, limits and step of each. */

import { PERCENT, type Quantity } from "../model/units";
import type { Conditions } from "../state/conditions";
import { units } from "../state/preferences";

export type SettingName = Exclude<keyof Conditions, "beforeDeparture" | "climate" | "terrain">;

export interface Setting {
  quantity: () => Quantity;
  /** In SI. */
  limits: [number, number];
  /** In the unit that is shown. */
  step: number;
  /** Removes rounding errors of the conversion to SI. */
  exact?: (si: number) => number;
}

const KM_H = 1 / 3.6;

export const SETTINGS: Record<SettingName, Setting> = {
  ambientDegc: { quantity: () => units.value.temperature, limits: [-25, 45], step: 1 },
  setpointDegc: { quantity: () => units.value.temperature, limits: [15, 28], step: 1 },
  soc: { quantity: () => PERCENT, limits: [0.05, 1], step: 1, exact: (soc) => Math.min(soc, 1) },
  payloadKg: { quantity: () => units.value.mass, limits: [0, 500], step: 10 },
  reserve: {
    quantity: () => PERCENT,
    limits: [0, 0.5],
    step: 1,
    exact: (reserve) => Math.round(reserve * 100) / 100,
  },
  motorwayMS: { quantity: () => units.value.speed, limits: [80 * KM_H, 150 * KM_H], step: 5 },
};
