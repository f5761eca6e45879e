/** A planned road with another speed on its fast links. */

import type { Link } from "../api/types";

/** Links that are planned faster than this are motorway. */
export const MOTORWAY_M_S = 100 / 3.6;

function speedOf(link: Link): number {
  return link.speed_m_s ?? link.length_m / (link.travel_time_s as number);
}

export function hasMotorway(links: Link[]): boolean {
  return links.some((link) => speedOf(link) > MOTORWAY_M_S);
}

/** The links with their motorway driven at `speedMS`; as planned when it is null. */
export function atMotorwaySpeed(links: Link[], speedMS: number | null): Link[] {
  if (speedMS === null) return links;
  return links.map((link) => {
    if (speedOf(link) <= MOTORWAY_M_S) return link;
    const stop = link.stop_s ?? 0;
    const faster: Link = {
      ...link,
      travel_time_s: link.length_m / speedMS + stop,
      stop_s: stop,
      moving_speed_m_s: speedMS,
    };
    delete faster.speed_m_s;
    delete faster.speed_limit_m_s;
    return faster;
  });
}
