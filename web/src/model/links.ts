/** Links of a planned route with another speed on the motorway, or wherever it is faster than another. */

import type { Link } from "../api/documents";

/** Links with a higher planned speed count as motorway. */
const MOTORWAY_M_S = 100 / 3.6;

function speedOf({ moving_speed_m_s, speed_m_s, length_m, travel_time_s }: Link): number {
  return moving_speed_m_s ?? speed_m_s ?? length_m / (travel_time_s as number);
}

export function hasMotorway(links: Link[]): boolean {
  return links.some((link) => speedOf(link) > MOTORWAY_M_S);
}

/** The links with `speedMS` on the motorway, or where they are faster than `fromMS`; unchanged when it is null. */
export function atMotorwaySpeed(links: Link[], speedMS: number | null, fromMS = MOTORWAY_M_S): Link[] {
  if (speedMS === null) return links;
  return links.map((link) => {
    if (speedOf(link) <= fromMS) return link;
    const stop = link.stop_s ?? 0;
    const lost = (link.travel_time_s ?? 0) - link.length_m / speedOf(link);
    const changed: Link = {
      ...link,
      travel_time_s: link.length_m / speedMS + Math.max(stop, lost),
      stop_s: stop,
      moving_speed_m_s: speedMS,
    };
    delete changed.speed_m_s;
    delete changed.speed_limit_m_s;
    return changed;
  });
}
