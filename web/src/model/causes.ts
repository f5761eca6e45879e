/** Energy by cause, in the order of the table. */

export type Group = "motion" | "comfort" | "learned";

/** Causes of the service, with their groups. */
export const CAUSES = {
  air: "motion",
  rolling: "motion",
  climb: "motion",
  acceleration: "motion",
  friction_brakes: "motion",
  drivetrain: "motion",
  shortfall: "motion",
  climate: "comfort",
  base_load: "comfort",
  correction: "learned",
} satisfies Record<string, Group>;

/** Parts below this share of the sum of all magnitudes are left out. */
const MIN_SHARE = 0.002;

export interface Step {
  key: string;
  group: Group;
  energyWh: number;
  /** Sum of the parts before this one. */
  startWh: number;
}

/** The parts in order, each starting at the sum of those before it; the last ends at the total. */
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
    if (Math.abs(energyWh) > MIN_SHARE * whole || alsoShown.has(key)) {
      steps.push({ key, group, energyWh, startWh });
    }
    startWh += energyWh;
  }
  return steps;
}
