/** The service's flags in the reader's words. What is not known here is shown as it came. */

const NAMES: Record<string, string> = {
  ambient_temperature_degc: "the outside temperature",
  cabin_setpoint_degc: "the cabin set-point",
  cabin_temperature_degc: "the cabin's temperature at departure",
  battery_temperature_degc: "the battery's temperature at departure",
  duration_s: "the duration",
  payload_mass_kg: "the load",
};

const LIMITS: Record<string, string> = {
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

const NOT_SERIOUS_BELOW = 1;

export interface Warning {
  text: string;
  /** What it does to the forecast. */
  effect: string;
  serious: boolean;
}

function listed(names: string[]): string {
  const last = names.at(-1) as string;
  const text = names.length > 1 ? `${names.slice(0, -1).join(", ")} and ${last}` : last;
  return `${text[0]?.toUpperCase()}${text.slice(1)}`;
}

function nameOf(key: string): string {
  return NAMES[key] ?? key.replaceAll("_", " ");
}

type Reading = [RegExp, (found: string[][]) => Warning];

/** Flags of one kind are told in one sentence. */
const READINGS: Reading[] = [
  [
    /^(\S+) is outside the training range by ([\d.]+) sd$/,
    (found) => {
      const furthest = Math.max(...found.map(([, beyond]) => Number(beyond)));
      const names = listed(found.map(([name]) => nameOf(name as string)));
      const [verb, upTo] = found.length > 1 ? ["are", "up to "] : ["is", ""];
      return {
        text: `${names} ${verb} beyond the trips this model learned from, by ${upTo}${furthest.toFixed(1)} standard deviations.`,
        effect: "The band is wider for it.",
        serious: furthest >= NOT_SERIOUS_BELOW,
      };
    },
  ],
  [
    /^(\S+) is unknown: its usual value is assumed$/,
    (found) => ({
      text: `${listed(found.map(([name]) => nameOf(name as string)))}: not known, the usual is assumed.`,
      effect: "The band is wider for it.",
      serious: false,
    }),
  ],
  [
    /^(no trip of this car was measured): (.+)$/,
    ([found]) => ({
      text: `No trip of this car was measured. The forecast takes ${found?.[1]}.`,
      effect: "The band is wider for it.",
      serious: true,
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
    (found) => ({
      text: `The car cannot follow the speed: ${found
        .map(([limit, count]) => `${LIMITS[limit as string]} (${count} samples)`)
        .join(", ")}.`,
      effect: "It is taken to drive as fast as it can.",
      serious: true,
    }),
  ],
  [
    /^(battery [\w-]+): (\d+) samples$/,
    (found) => ({
      text: found
        .map(([state, count]) => `${STATES[state as string] ?? state} (${count} samples).`)
        .join(" "),
      effect: "",
      serious: false,
    }),
  ],
];

/** What the flags say, in the order of the readings; what no reading knows comes last. */
export function warningsOf(flags: string[]): Warning[] {
  const read = new Set<string>();
  const warnings: Warning[] = [];
  for (const [pattern, tell] of READINGS) {
    const matching = flags.filter((flag) => pattern.test(flag));
    if (matching.length === 0) continue;
    for (const flag of matching) read.add(flag);
    warnings.push(tell(matching.map((flag) => (pattern.exec(flag) as RegExpExecArray).slice(1))));
  }
  const others = flags.filter((flag) => !read.has(flag));
  return [...warnings, ...others.map((flag) => ({ text: `${listed([flag])}.`, effect: "", serious: false }))];
}
