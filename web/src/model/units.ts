/** Conversions between SI and the units of the page. */

/** Metric; British: miles, and degrees Celsius, metres and kilograms; imperial: those of the United States. */
export type System = "metric" | "british" | "imperial";

/** Regions that measure roads in miles. */
const BRITISH = /^(GB|IM|JE|GG)$/;
const IMPERIAL = /^(US|LR|PR|GU|VI|AS|MP)$/;

/** The usual system of a locale, such as "en-GB". */
export function systemOf(locale: string): System {
  const region = new Intl.Locale(locale).region ?? "";
  if (BRITISH.test(region)) return "british";
  return IMPERIAL.test(region) ? "imperial" : "metric";
}

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
export const MINUTES = scaled("min", 60, 0);
export const HOURS = scaled("h", 3600, 1);
const ANGLE = scaled("°", 1, 0);
const RAIN = scaled("mm/h", 1, 1);
const PRESSURE = scaled("hPa", 100, 0);

const METRIC = {
  distance: scaled("km", 1000, 1),
  speed: scaled("km/h", 1 / 3.6, 0),
  height: scaled("m", 1, 0),
  temperature: CELSIUS,
  mass: scaled("kg", 1, 0),
  consumption: scaled("kWh/100 km", 0.01, 1),
};

const BY_MILE = {
  distance: scaled("mi", M_PER_MILE, 1),
  speed: scaled("mph", M_PER_MILE / 3600, 0),
  consumption: {
    unit: "mi/kWh",
    digits: 1,
    from: (whPerM: number) => 1000 / M_PER_MILE / whPerM,
    to: (milesPerKwh: number) => 1000 / M_PER_MILE / milesPerKwh,
  },
};

const SYSTEMS = {
  metric: METRIC,
  british: { ...METRIC, ...BY_MILE },
  imperial: {
    ...METRIC,
    ...BY_MILE,
    height: scaled("ft", M_PER_FOOT, 0),
    temperature: FAHRENHEIT,
    mass: scaled("lb", KG_PER_POUND, 0),
  },
} satisfies Record<System, Record<string, Quantity>>;

export type Units = Record<keyof typeof METRIC, Quantity>;

export function unitsOf(system: System): Units {
  return SYSTEMS[system];
}

/** The quantity of a value whose unit in the service is `unit`; "" is a fraction. */
export function quantityIn(unit: string, { temperature, mass, speed }: Units): Quantity {
  const known: Record<string, Quantity> = {
    "": PERCENT,
    "°C": temperature,
    kg: mass,
    "m/s": speed,
    "°": ANGLE,
    "mm/h": RAIN,
    Pa: PRESSURE,
  };
  return known[unit] ?? scaled(unit, 1, 1);
}
