/** Names of the causes of energy, in the order in which they are told. */

export interface Cause {
  key: string;
  label: string;
  group: "motion" | "comfort" | "learned";
}

export const CAUSES: Cause[] = [
  { key: "air", label: "Air drag", group: "motion" },
  { key: "rolling", label: "Tyres", group: "motion" },
  { key: "climb", label: "Hills", group: "motion" },
  { key: "acceleration", label: "Speed gained", group: "motion" },
  { key: "friction_brakes", label: "Brakes", group: "motion" },
  { key: "drivetrain", label: "Motor and gears", group: "motion" },
  { key: "shortfall", label: "Not followed", group: "motion" },
  { key: "hvac", label: "Heating and cooling", group: "comfort" },
  { key: "base_load", label: "Electronics", group: "comfort" },
  { key: "learned_correction", label: "Learned from trips", group: "learned" },
];

/** Smaller parts than this share of the whole are not drawn. */
const LEAST_SHARE = 0.002;

export interface Step extends Cause {
  energyWh: number;
  /** Sum of the parts before this one. */
  startWh: number;
}

/** The parts one after the other, each from where the last one ended; the last ends at the whole. */
export function waterfall(byCauseWh: Record<string, number>, alsoShown: ReadonlySet<string>): Step[] {
  const whole = Object.values(byCauseWh).reduce((sum, part) => sum + Math.abs(part), 0);
  const known = new Set(CAUSES.map(({ key }) => key));
  const more = Object.keys(byCauseWh).filter((key) => !known.has(key));
  const causes = [...CAUSES, ...more.map((key): Cause => ({ key, label: key, group: "motion" }))];
  let startWh = 0;
  const steps: Step[] = [];
  for (const cause of causes) {
    const energyWh = byCauseWh[cause.key] ?? 0;
    if (Math.abs(energyWh) > LEAST_SHARE * whole || alsoShown.has(cause.key)) {
      steps.push({ ...cause, energyWh, startWh });
    }
    startWh += energyWh;
  }
  return steps;
}
