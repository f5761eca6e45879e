/** Links of a planned route with another speed on the motorway. */

import type { Link } from "../api/documents";

/** Links with a higher planned speed count as motorway. */
const MOTORWAY_M_S = 100 / 3.6;

function speedOf(link: Link): number {
  return link.speed_m_s ?? link.length_m / (link.travel_time_s as number);
}

export function hasMotorway(links: Link[]): boolean {
  return links.some((link) => speedOf(link) > MOTORWAY_M_S);
}

/** The links with `speedMS` on the motorway; unchanged when it is null. */
export function atMotorwaySpeed(links: Link[], speedMS: number | null): Link[] {
  if (speedMS === null) return links;
  return links.map((link) => {
    if (speedOf(link) <= MOTORWAY_M_S) return link;
    const stop = link.stop_s ?? 0;
    const changed: Link = {
      ...link,
      travel_time_s: link.length_m / speedMS + stop,
      stop_s: stop,
      moving_speed_m_s: speedMS,
    };
    delete changed.speed_m_s;
    delete changed.speed_limit_m_s;
    return changed;
  });
}
