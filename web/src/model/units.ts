/** Conversions between SI and the units of the page. */

export type System = "metric" | "imperial";

export interface Quantity {
  unit: string;
  /** Digits after the decimal sign of a shown value. */
  digits: number;
  from: (si: number) => number;
  to: (shown: number) => number;
}

const M_PER_MILE = 1609.344;
const M_PER_FOOT = 0.3048;
const KG_PER_POUND = 0.45359237;

function scaled(unit: string, perUnit: number, digits: number): Quantity {
  return { unit, digits, from: (si) => si / perUnit, to: (shown) => shown * perUnit };
}

const CELSIUS: Quantity = { unit: "°C", digits: 0, from: (c) => c, to: (c) => c };
const FAHRENHEIT: Quantity = {
  unit: "°F",
  digits: 0,
  from: (c) => c * 1.8 + 32,
  to: (f) => (f - 32) / 1.8,
};

export const PERCENT = scaled("%", 0.01, 0);
export const ENERGY = scaled("kWh", 1000, 2);
export const POWER = scaled("kW", 1000, 0);

const SYSTEMS = {
  metric: {
    distance: scaled("km", 1000, 1),
    speed: scaled("km/h", 1 / 3.6, 0),
    height: scaled("m", 1, 0),
    temperature: CELSIUS,
    mass: scaled("kg", 1, 0),
    consumption: scaled("kWh/100 km", 0.01, 1),
  },
  imperial: {
    distance: scaled("mi", M_PER_MILE, 1),
    speed: scaled("mph", M_PER_MILE / 3600, 0),
    height: scaled("ft", M_PER_FOOT, 0),
    temperature: FAHRENHEIT,
    mass: scaled("lb", KG_PER_POUND, 0),
    consumption: {
      unit: "mi/kWh",
      digits: 1,
      from: (whPerM: number) => 1000 / M_PER_MILE / whPerM,
      to: (milesPerKwh: number) => 1000 / M_PER_MILE / milesPerKwh,
    },
  },
} satisfies Record<System, Record<string, Quantity>>;

export type Units = Record<keyof (typeof SYSTEMS)["metric"], Quantity>;

export function unitsOf(system: System): Units {
  return SYSTEMS[system];
}
