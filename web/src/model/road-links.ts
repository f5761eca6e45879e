/** A road with speeds as links: the plan of a trip whose departure is not known yet. */

import type { Link } from "../api/documents";
import type { Profile } from "./profile";

/** Length of a link, but for the last one [m]. */
const LINK_M = 250;
/** A slower car stands. */
const STANDS_M_S = 0.5;

/** Links of about 250 m with the time that the profile takes, and the elevation at their ends. */
export function linksOfProfile({ timeS, distanceM, speedMS, elevationM }: Profile) {
  const links: Link[] = [];
  const position_m = [0];
  const elevation_m = [elevationM?.[0] ?? Number.NaN];
  let start = 0;
  let stop_s = 0;
  for (let k = 1; k < timeS.length; k++) {
    const at = distanceM[k] as number;
    if ((speedMS[k] as number) < STANDS_M_S) stop_s += (timeS[k] as number) - (timeS[k - 1] as number);
    const length_m = at - (distanceM[start] as number);
    if (length_m < LINK_M && k < timeS.length - 1) continue;
    const travel_time_s = (timeS[k] as number) - (timeS[start] as number);
    if (length_m <= 0) break;
    links.push({ length_m, travel_time_s, stop_s: Math.min(stop_s, travel_time_s / 2) });
    position_m.push(at);
    elevation_m.push(elevationM?.[k] ?? Number.NaN);
    start = k;
    stop_s = 0;
  }
  const known = elevationM !== null && elevation_m.every(Number.isFinite);
  return { links, elevation: known ? { position_m, elevation_m } : null };
}
