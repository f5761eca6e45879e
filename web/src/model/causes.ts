/** Energy by cause, in the order of the table. */

export type Group = "motion" | "comfort" | "learned";

/** Causes that the service names, and what they belong to. */
export const CAUSES = {
  air: "motion",
  rolling: "motion",
  climb: "motion",
  acceleration: "motion",
  friction_brakes: "motion",
  drivetrain: "motion",
  shortfall: "motion",
  hvac: "comfort",
  base_load: "comfort",
  learned_correction: "learned",
} satisfies Record<string, Group>;

export type CauseKey = keyof typeof CAUSES;

/** Smaller parts than this share of the whole are not drawn. */
const LEAST_SHARE = 0.002;

export interface Step {
  key: string;
  group: Group;
  energyWh: number;
  /** Sum of the parts before this one. */
  startWh: number;
}

/** The parts one after the other, each from where the last one ended; the last ends at the whole. */
export function waterfall(byCauseWh: Record<string, number>, alsoShown: ReadonlySet<string>): Step[] {
  const whole = Object.values(byCauseWh).reduce((sum, part) => sum + Math.abs(part), 0);
  const more = Object.keys(byCauseWh).filter((key) => !(key in CAUSES));
  const causes: [string, Group][] = [
    ...Object.entries(CAUSES),
    ...more.map((key): [string, Group] => [key, "motion"]),
  ];
  let startWh = 0;
  const steps: Step[] = [];
  for (const [key, group] of causes) {
    const energyWh = byCauseWh[key] ?? 0;
    if (Math.abs(energyWh) > LEAST_SHARE * whole || alsoShown.has(key)) {
      steps.push({ key, group, energyWh, startWh });
    }
    startWh += energyWh;
  }
  return steps;
}
