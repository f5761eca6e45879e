/** The settings of a trip that a slider changes: quantity, limits and step of each. */

import { FIELDS } from "../../generated/fields";
import type { AskedName, NumberName } from "../model/fields";
import { MINUTES, PERCENT, quantityIn, type Quantity } from "../model/units";
import { units } from "../state/preferences";

export type SettingName = Extract<NumberName, AskedName> | "reserve" | "stopOverheadS" | "motorwayMS";

const KM_H = 1 / 3.6;

/** Sliders that do not go from bound to bound of their field in steps of one. */
const SLIDERS: Partial<Record<SettingName, { limits?: [number, number]; step?: number }>> = {
  ambient_temperature_degc: { limits: [-25, 45] },
  cabin_setpoint_degc: { limits: [15, 28] },
  payload_mass_kg: { limits: [0, 500], step: 10 },
  reserve: { limits: [0, 0.5] },
  stopOverheadS: { limits: [0, 30 * 60] },
  motorwayMS: { limits: [80 * KM_H, 150 * KM_H], step: 5 },
  wind_speed_m_s: { limits: [0, 100 * KM_H], step: 5 },
  wind_from_deg: { step: 10 },
  rain_mm_h: { limits: [0, 20], step: 0.5 },
  tyre_pressure: { limits: [0.6, 1.2], step: 5 },
  pressure_pa: { limits: [70_000, 105_000], step: 5 },
};

function tableOf(name: SettingName): { quantity: Quantity; limits: [number, number] } {
  if (name === "motorwayMS") return { quantity: units.value.speed, limits: [0, 1] };
  if (name === "reserve") return { quantity: PERCENT, limits: [0, 1] };
  if (name === "stopOverheadS") return { quantity: MINUTES, limits: [0, 1] };
  const { unit, minimum, maximum } = FIELDS[name];
  return { quantity: quantityIn(unit, units.value), limits: [minimum, maximum] };
}

/** Quantity, limits in SI, and the step in the unit that is shown. */
export function settingOf(name: SettingName) {
  return { step: 1, ...tableOf(name), ...SLIDERS[name] };
}
