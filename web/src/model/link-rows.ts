/** Links as the rows of a table, in which a value may be missing. */

import type { Link } from "../api/documents";

/** Null for an empty field. */
export interface LinkRow {
  lengthM: number | null;
  speedMS: number | null;
  /** Elevation at the end of the link. */
  heightM: number | null;
}

export const EMPTY_ROW: LinkRow = { lengthM: null, speedMS: null, heightM: null };

/** Links with at least this speed have no stop [m/s]: 54 km/h. */
export const OPEN_ROAD_M_S = 15;

/**
 * The rows as links; empty rows are left out, and a missing value stays missing for the service to name it.
 * An end without a height has that of the end before; without any height the road has no elevation.
 */
export function linksOfRows(
  rows: readonly LinkRow[],
  startM: number | null,
): Record<string, number | null>[] {
  const filled = rows.filter(({ lengthM, speedMS }) => lengthM !== null || speedMS !== null);
  const known = [startM, ...filled.map(({ heightM }) => heightM)].find((height) => height !== null);
  let heightM = startM ?? known ?? null;
  return filled.map((row) => {
    const start_elevation_m = heightM;
    heightM = row.heightM ?? heightM;
    return {
      length_m: row.lengthM,
      speed_m_s: row.speedMS,
      ...((row.speedMS ?? 0) >= OPEN_ROAD_M_S && { stop_s: 0 }),
      ...(heightM !== null && { start_elevation_m, end_elevation_m: heightM }),
    };
  });
}

/** Rows and elevation at the start of links. */
export function rowsOfLinks(links: readonly Link[]): { rows: LinkRow[]; startM: number | null } {
  const rows = links.map((link) => ({
    lengthM: link.length_m,
    speedMS: link.speed_m_s ?? (link.travel_time_s ? link.length_m / link.travel_time_s : null),
    heightM: link.end_elevation_m ?? null,
  }));
  return { rows, startM: links[0]?.start_elevation_m ?? null };
}
