/** Links as the rows of a table, in which a value may be missing. */

/** Null for an empty field. */
export interface LinkRow {
  lengthM: number | null;
  speedMS: number | null;
  /** Elevation at the end of the link. */
  heightM: number | null;
}

export const EMPTY_ROW: LinkRow = { lengthM: null, speedMS: null, heightM: null };

/** Links with at least this speed have no stop [m/s]: 54 km/h. */
const OPEN_ROAD_M_S = 15;

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

/** Elevation at the start of an invented route [m]. */
export const SAMPLE_START_M = 510;

/** This route as an example: a town, country roads, a motorway over a hill, and a town. */
export const SAMPLE_ROWS: LinkRow[] = [
  { lengthM: 1800, speedMS: 8.5, heightM: 515 },
  { lengthM: 8600, speedMS: 19, heightM: 560 },
  { lengthM: 23000, speedMS: 33.3, heightM: 780 },
  { lengthM: 23500, speedMS: 32.2, heightM: 540 },
  { lengthM: 7800, speedMS: 15, heightM: 490 },
];
