/** Marks on the map that do not hide each other. Positions are pixels, to the right and down. */

/** Where the body of a pin stands, from its tip: signs to the right and down. */
export type Lean = readonly [1 | -1, 1 | -1];

export type Pixel = readonly [number, number];

/** Above and to the right of the tip first. */
const LEANS: readonly Lean[] = [
  [1, -1],
  [-1, -1],
  [1, 1],
  [-1, 1],
];

/** Side of the body of a pin [px]. */
export const PIN_PX = 34;
/** Stops nearer than this share a mark [px]. */
const APART_PX = 24;
/** Half of the side of a mark of a stop [px]. */
const STOP_PX = 11;

type Box = readonly [left: number, top: number, right: number, bottom: number];

function around([x, y]: Pixel, half: number): Box {
  return [x - half, y - half, x + half, y + half];
}

function bodyOf([x, y]: Pixel, [right, down]: Lean): Box {
  return around([x + (right * PIN_PX) / 2, y + (down * PIN_PX) / 2], PIN_PX / 2);
}

function overlap(one: Box, other: Box): number {
  const width = Math.min(one[2], other[2]) - Math.max(one[0], other[0]);
  const height = Math.min(one[3], other[3]) - Math.max(one[1], other[1]);
  return Math.max(width, 0) * Math.max(height, 0);
}

/** How each pin leans, so that it covers as little as possible of earlier pins and of stops. */
export function leansOf(tips: readonly Pixel[], stops: readonly Pixel[]): Lean[] {
  const taken = stops.map((stop) => around(stop, STOP_PX));
  return tips.map((tip) => {
    const covered = LEANS.map((lean) => taken.reduce((sum, box) => sum + overlap(bodyOf(tip, lean), box), 0));
    const lean = LEANS[covered.indexOf(Math.min(...covered))] as Lean;
    taken.push(bodyOf(tip, lean));
    return lean;
  });
}

/** Stops that are too near each other for marks of their own, by their indices. */
export function groupsOf(stops: readonly Pixel[]): number[][] {
  const groups: number[][] = [];
  for (const [k, [x, y]] of stops.entries()) {
    const near = groups.find((group) => {
      const [firstX, firstY] = stops[group[0] as number] as Pixel;
      return Math.hypot(x - firstX, y - firstY) < APART_PX;
    });
    if (near) near.push(k);
    else groups.push([k]);
  }
  return groups;
}

/** Numbers of stops in a mark: "3", "2–4", "1+7". */
export function numbersText(numbers: readonly number[]): string {
  const runs: [number, number][] = [];
  for (const number of numbers) {
    const last = runs.at(-1);
    if (last?.[1] === number - 1) last[1] = number;
    else runs.push([number, number]);
  }
  return runs.map(([first, last]) => (first === last ? `${first}` : `${first}–${last}`)).join("+");
}
