/** A trip on the road: the charge as planned at departure, as driven, and as expected now. */

import { useMemo } from "preact/hooks";
import type uPlot from "uplot";
import type { LiveForecast } from "../api/documents";
import { interpolate } from "../model/interpolate";
import { PERCENT } from "../model/units";
import { format, system, text, units } from "../state/preferences";
import { alongAxis, axis, EDGE, line, percent } from "./axes";
import { type Mark, placeMarks } from "./marks";
import { type ChartOptions, type Look, Plot } from "./plot";

const MARGIN = 3;

interface Props {
  of: LiveForecast;
  /** Distance of the car since departure [m]. */
  carM: number;
  height: number;
  label: string;
  isNight: boolean;
}

/** The columns of the chart; the line now is driven behind the car, and expected ahead of it. */
function columnsOf({ course }: LiveForecast, carM: number): uPlot.AlignedData {
  const xs = [...new Set([...course.distance_m, carM])].sort((a, b) => a - b);
  const at = (curve: number[]) => xs.map((x) => PERCENT.from(interpolate(x, course.distance_m, curve)));
  const now = at(course.expected);
  return [
    xs.map(units.value.distance.from),
    at(course.high),
    at(course.low),
    at(course.planned),
    now.map((y, k) => ((xs[k] as number) >= carM ? y : null)),
    now.map((y, k) => ((xs[k] as number) <= carM ? y : null)),
  ];
}

function marksOf({ course, reserve }: LiveForecast, carM: number): Mark[] {
  const now = PERCENT.from(interpolate(carM, course.distance_m, course.expected));
  const kept = text.value.result.reserve(format.value.shown(reserve, PERCENT));
  return [
    ...(reserve > 0 ? [{ kind: "reserve", text: kept, y: PERCENT.from(reserve) }] : []),
    { kind: "car", text: "", x: units.value.distance.from(carM), y: now },
  ];
}

export function CourseChart({ of, carM, height, label, isNight }: Props) {
  const data = useMemo(() => columnsOf(of, carM), [of, carM, system.value]);
  const reserve = PERCENT.from(of.reserve);
  const options = ({ palette }: Look): ChartOptions => ({
    padding: [12, 26, 0, 0],
    scales: {
      x: { time: false },
      y: {
        range: (_, low, high) => [Math.max(0, Math.min(low, reserve) - MARGIN), Math.min(100, high + MARGIN)],
      },
    },
    axes: [alongAxis(palette), axis({ palette, scale: "y", text: percent, space: 28 })],
    bands: [{ series: [1, 2], fill: palette["main-band"] }],
    series: [
      {},
      EDGE,
      EDGE,
      line(palette.muted, { width: 2, dash: [2, 5] }),
      line(palette.main, { width: 3 }),
      line(palette.driven, { width: 4 }),
    ],
  });
  return (
    <Plot
      label={label}
      data={data}
      height={height}
      variant={isNight ? "night" : ""}
      options={options}
      onDraw={(plot) => placeMarks(plot, marksOf(of, carM))}
    />
  );
}
