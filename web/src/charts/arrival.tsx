/** Battery charge on arrival as twenty equally likely dots. */

import { useMemo, useRef } from "preact/hooks";
import type uPlot from "uplot";
import type { Forecast } from "../api/documents";
import { equallyLikely } from "../model/arrival";
import { PERCENT } from "../model/units";
import { format, text } from "../state/preferences";
import { axis, percent } from "./axes";
import { type Mark, placeMarks } from "./marks";
import { type ChartOptions, type Look, Plot } from "./plot";

const COLUMNS = 18;
const LARGEST_DOT = 19;
const SPANS = [0.5, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128];
/** Half of the longest label of the axis [px]. */
const PADDING = 24;
/** How far the axis goes beyond an empty and a full battery [%]. */
const BEYOND = 2;
/** Height of the labels above and the axis below [px]. */
const FRAME_PX = 48;

interface DotPlot {
  data: uPlot.AlignedData;
  from: number;
  to: number;
  /** Number of dots in the highest column. */
  stack: number;
  reserveInside: boolean;
}

/** The range of the axis, and whether it includes the reserve. */
function range(min: number, max: number, reserve: number): [number, number, boolean] {
  const width = SPANS.find((span) => span >= (max - min) * 1.9) ?? (SPANS.at(-1) as number);
  const middle = (min + max) / 2;
  const inside = reserve > middle - 0.9 * width && reserve < middle + 0.9 * width;
  const low = Math.min(middle - width / 2, inside ? reserve - width * 0.1 : Number.POSITIVE_INFINITY);
  const high = Math.max(middle + width / 2, inside ? reserve + width * 0.1 : Number.NEGATIVE_INFINITY);
  return [Math.max(low, -BEYOND), Math.min(high, 100 + BEYOND), inside];
}

/** Dots of one forecast, in a range that includes those of all `shared` forecasts. */
function dotsOf(forecast: Forecast, shared: Forecast[], reserveSoc: number): DotPlot {
  const socs = equallyLikely(forecast).map(PERCENT.from);
  const reserve = PERCENT.from(reserveSoc);
  const all = shared.flatMap(equallyLikely).map(PERCENT.from);
  const [from, to, reserveInside] = range(Math.min(...all), Math.max(...all), reserve);
  const step = (to - from) / COLUMNS;
  const heights = new Map<number, number>();
  const xs: number[] = [];
  const kept: (number | null)[] = [];
  const missed: (number | null)[] = [];
  for (const soc of socs) {
    const column = Math.floor((soc - from) / step);
    const height = heights.get(column) ?? 0;
    heights.set(column, height + 1);
    xs.push(from + (column + 0.5) * step);
    kept.push(soc >= reserve ? height + 0.5 : null);
    missed.push(soc < reserve ? height + 0.5 : null);
  }
  return { data: [xs, kept, missed], from, to, stack: Math.max(...heights.values()), reserveInside };
}

interface Props {
  forecast: Forecast;
  /** All forecasts of the card; they have the same axis. */
  shared: Forecast[];
  /** Whether this is the second forecast of a comparison. */
  isOther?: boolean;
  reserve: number;
  height: number;
  label: string;
}

export function ArrivalChart({ forecast, shared, isOther = false, reserve, height, label }: Props) {
  const dots = useMemo(
    () => dotsOf(forecast, shared, reserve),
    [forecast, shared.length, shared.at(-1), reserve],
  );
  const latest = useRef(dots); // options outlive the data
  latest.current = dots;
  const options = ({ palette, width }: Look): ChartOptions => {
    // the largest diameter with which all dots fit [px]
    const size = Math.min(
      (width - 2 * PADDING) / COLUMNS - 1,
      (height - FRAME_PX) / dots.stack - 1,
      LARGEST_DOT,
    );
    const series = (fill: string): uPlot.Series => ({
      paths: () => null,
      points: { show: true, size, fill, stroke: fill, width: 0 },
    });
    return {
      padding: [18, PADDING, 0, PADDING],
      scales: {
        x: { time: false, range: () => [latest.current.from, latest.current.to] },
        y: { range: () => [0, (height - FRAME_PX) / (size + 1)] },
      },
      axes: [
        axis({
          palette,
          scale: "x",
          grid: false,
          text: (x) => (x < 0 || x > 100 ? "" : percent(x)),
          space: 60,
        }),
        { show: false },
      ],
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
      onDraw={(plot) => {
        placeMarks(plot, marks(dots, reserve));
      }}
    />
  );
}

function marks({ reserveInside, from, to }: DotPlot, reserve: number): Mark[] {
  const label = text.value.result.reserve(format.value.shown(reserve, PERCENT));
  if (reserveInside) return [{ kind: "reserve", text: label, x: PERCENT.from(reserve) }];
  const below = PERCENT.from(reserve) < from;
  const aside = below ? `← ${label}` : `${label} →`;
  return [{ kind: "aside", text: aside, x: below ? from : to, at: below ? "right" : "left" }];
}
