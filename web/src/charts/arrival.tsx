/** The charge at the end as twenty equally likely dots. */

import { useMemo } from "preact/hooks";
import type uPlot from "uplot";
import type { Answer } from "../api/types";
import { equallyLikely } from "../model/arrival";
import { PERCENT } from "../model/units";
import { format, text } from "../state/preferences";
import { axis, percent } from "./axes";
import { type Mark, placeMarks } from "./marks";
import { type Look, Plot } from "./plot";

const COLUMNS = 18;
const LARGEST_DOT = 19;
const SPANS = [0.5, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192];
const ROOM = 10;
/** What labels above and the axis below take of the height. */
const FRAME = 48;

interface Dots {
  data: uPlot.AlignedData;
  from: number;
  to: number;
  /** Dots of the highest column. */
  stack: number;
  reserveInside: boolean;
}

function range(least: number, most: number, reserve: number): [number, number, boolean] {
  const width = SPANS.find((span) => span >= (most - least) * 1.9) ?? (SPANS.at(-1) as number);
  const middle = (least + most) / 2;
  const inside = reserve > middle - 0.9 * width && reserve < middle + 0.9 * width;
  const low = Math.min(middle - width / 2, inside ? reserve - width * 0.1 : Number.POSITIVE_INFINITY);
  const high = Math.max(middle + width / 2, inside ? reserve + width * 0.1 : Number.NEGATIVE_INFINITY);
  return [low, high, inside];
}

/** Dots of one answer, in a range that holds all of `shared`. */
function dotsOf(answer: Answer, shared: Answer[], reserveSoc: number): Dots {
  const places = equallyLikely(answer).map(PERCENT.from);
  const reserve = PERCENT.from(reserveSoc);
  const all = shared.flatMap(equallyLikely).map(PERCENT.from);
  const [from, to, reserveInside] = range(Math.min(...all), Math.max(...all), reserve);
  const step = (to - from) / COLUMNS;
  const heights = new Map<number, number>();
  const xs: number[] = [];
  const kept: (number | null)[] = [];
  const missed: (number | null)[] = [];
  for (const place of places) {
    const column = Math.floor((place - from) / step);
    const height = heights.get(column) ?? 0;
    heights.set(column, height + 1);
    xs.push(from + (column + 0.5) * step);
    kept.push(place >= reserve ? height + 0.5 : null);
    missed.push(place < reserve ? height + 0.5 : null);
  }
  ranges.set(kept, [from, to]);
  return { data: [xs, kept, missed], from, to, stack: Math.max(...heights.values()), reserveInside };
}

/** Dots as large as columns and stacks allow. */
function dotSize(width: number, height: number, stack: number): number {
  return Math.min((width - 2 * ROOM) / COLUMNS - 1, (height - FRAME) / stack - 1, LARGEST_DOT);
}

interface Props {
  answer: Answer;
  /** Answers that are shown beside it, on the same axis. */
  shared: Answer[];
  /** Whether it is the second side of a comparison. */
  isOther?: boolean;
  reserve: number;
  height: number;
  label: string;
}

export function ArrivalChart({ answer, shared, isOther = false, reserve, height, label }: Props) {
  const dots = useMemo(
    () => dotsOf(answer, shared, reserve),
    [answer, shared.length, shared.at(-1), reserve],
  );
  const options = ({ palette, width }: Look): uPlot.Options => {
    const size = dotSize(width, height, dots.stack);
    const series = (fill: string): uPlot.Series => ({
      paths: () => null,
      points: { show: true, size, fill, stroke: fill, width: 0 },
    });
    return {
      width,
      height,
      padding: [18, ROOM, 0, ROOM],
      legend: { show: false },
      cursor: { show: false },
      scales: {
        x: { time: false, range: (plot) => rangeOf(plot.data) },
        y: { range: () => [0, (height - FRAME) / (size + 1)] },
      },
      axes: [axis({ palette, scale: "x", grid: false, text: percent, space: 54 }), { show: false }],
      series: [{}, series(isOther ? palette.other : palette.main), series(palette.alarm)],
    };
  };
  return (
    <Plot
      label={label}
      data={dots.data}
      height={height}
      options={options}
      variant={String(dots.stack)}
      drawn={(plot) => {
        placeMarks(plot, marks(dots, reserve));
      }}
    />
  );
}

/** uPlot asks for the range with the data that it has. */
const ranges = new WeakMap<object, [number, number]>();

function rangeOf(data: uPlot.AlignedData): [number, number] {
  return ranges.get(data[1] as object) ?? [0, 100];
}

function marks({ reserveInside, from, to }: Dots, reserve: number): Mark[] {
  const { result } = text.value;
  const level = format.value.shown(reserve, PERCENT);
  if (reserveInside) return [{ kind: "reserve", text: result.reserve(level), x: PERCENT.from(reserve) }];
  const below = PERCENT.from(reserve) < from;
  const aside = below ? result.reserveBelow(level) : result.reserveAbove(level);
  return [{ kind: "aside", text: aside, x: below ? from : to, at: below ? "right" : "left" }];
}
