/** A plan whose first charging stop is reached slowly, without heating and air conditioning. */

import type { ChargingPlan, Forecast } from "../api/documents";
import { arrivalBand, chanceAtAll, chanceOf } from "./arrival";
import { interpolate } from "./interpolate";

/** The way to the first stop, driven as usual and slowly. */
export interface Ways {
  usual: Forecast;
  slow: Forecast;
}

/** The chance that a plan is made for: to get there with the reserve; at all for who leaves with less, the reserve is 0 then. */
export function chanceThere(way: Forecast, reserve: number): number {
  return (reserve > 0 ? chanceOf(way, reserve) : null) ?? chanceAtAll(way);
}

/** A plan with the slow way: what it saves is charged at the stop less, and later times are later by what it takes longer. */
export function slowed(plan: ChargingPlan, { usual, slow }: Ways, reserve: number): ChargingPlan {
  const [first, ...later] = plan.stops;
  if (!first) return plan;
  const { distance_m: along, time_s, displayed_soc, ...bands } = slow.series;
  const { position_m, ...course } = plan.course;
  const moreS = (time_s.at(-1) as number) - first.arrives_after_s;
  const savedWh = usual.energy_wh - slow.energy_wh;
  const chance = chanceThere(slow, reserve);
  const kept = plan.p_reserve * (chance / Math.max(first.p_reach, Number.EPSILON));
  const atAll = plan.p_arrive * (chanceAtAll(slow) / Math.max(chanceAtAll(usual), Number.EPSILON));
  const arrival = position_m.findIndex((positionM) => positionM >= first.position_m);
  const before = (column: number[], then: number[], added = 0) =>
    column.map((value, k) => (k > arrival ? value + added : interpolate(position_m[k] ?? 0, along, then)));
  const causes = Object.entries(plan.by_cause_wh).map(([name, wh]) => {
    const saved = (usual.by_cause_wh[name] ?? 0) - (slow.by_cause_wh[name] ?? 0);
    return [name, wh - saved] as const;
  });
  const reached = {
    ...first,
    soc_arrival: slow.soc_arrival,
    soc_interval: arrivalBand(slow),
    p_reach: chance,
    energy_wh: first.energy_wh - savedWh,
    arrives_after_s: first.arrives_after_s + moreS,
  };
  return {
    ...plan,
    p_arrive: Math.min(atAll, chanceAtAll(slow)),
    p_reserve: Math.min(kept, chance),
    energy_wh: plan.energy_wh - savedWh,
    by_cause_wh: Object.fromEntries(causes),
    driving_s: plan.driving_s + moreS,
    stops: [reached, ...later.map((stop) => ({ ...stop, arrives_after_s: stop.arrives_after_s + moreS }))],
    course: {
      position_m,
      time_s: before(course.time_s, time_s, moreS),
      displayed_soc: before(course.displayed_soc, displayed_soc),
      low: before(course.low, bands.displayed_soc_low),
      high: before(course.high, bands.displayed_soc_high),
    },
  };
}
