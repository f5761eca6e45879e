/** The service's flags in the reader's words. What is not known here is shown as it came. */

const NAMES: Record<string, string> = {
  ambient_temperature_degc: "The outside temperature",
  cabin_setpoint_degc: "The cabin set-point",
  cabin_temperature_degc: "The cabin's temperature at departure",
  battery_temperature_degc: "The battery's temperature at departure",
  duration_s: "The duration",
  payload_mass_kg: "The load",
};

const CAUSES: Record<string, string> = {
  "motor torque limit": "its motor has not the torque",
  "motor power limit": "its motor has not the power",
  "motor speed limit": "its motor would turn too fast",
  "battery voltage floor": "its battery cannot give the power",
};

const STATES: Record<string, string> = {
  "battery empty": "The battery is empty before the end",
  "battery over-full": "The battery is too full to take back what braking gives",
  "battery over-voltage": "The battery's voltage is too high to take back what braking gives",
};

export interface Warning {
  text: string;
  /** What it does to the forecast. */
  effect: string;
  serious: boolean;
}

function nameOf(key: string): string {
  return NAMES[key] ?? key.replaceAll("_", " ");
}

type Reading = [RegExp, (...parts: string[]) => Warning];

const READINGS: Reading[] = [
  [
    /^(\S+) is outside the training range by ([\d.]+) sd$/,
    (name, beyond) => ({
      text: `${nameOf(name as string)} is beyond the trips this model learned from (${beyond} standard deviations).`,
      effect: "The band is wider for it.",
      serious: Number(beyond) >= 1,
    }),
  ],
  [
    /^(\S+) is unknown: its usual value is assumed$/,
    (name) => ({
      text: `${nameOf(name as string)} is not known; its usual value is assumed.`,
      effect: "The band is wider for it.",
      serious: false,
    }),
  ],
  [
    /^no elevation/,
    () => ({
      text: "The road has no elevation and counts as flat.",
      effect: "Hills are missing from the energy.",
      serious: false,
    }),
  ],
  [
    /^(motor \w+ limit|battery voltage floor): (\d+) samples$/,
    (limit, count) => ({
      text: `The car cannot follow the speed in ${count} ${count === "1" ? "sample" : "samples"}: ${CAUSES[limit as string]}.`,
      effect: "It is taken to drive as fast as it can.",
      serious: true,
    }),
  ],
  [
    /^(battery [\w-]+): (\d+) samples$/,
    (state, count) => ({
      text: `${STATES[state as string] ?? state}, in ${count} samples.`,
      effect: "",
      serious: state === "battery empty",
    }),
  ],
];

export function warningOf(flag: string): Warning {
  for (const [pattern, read] of READINGS) {
    const found = pattern.exec(flag);
    if (found) return read(...found.slice(1));
  }
  return { text: `${flag[0]?.toUpperCase()}${flag.slice(1)}.`, effect: "", serious: false };
}
