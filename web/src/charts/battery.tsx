/** Battery along the way, with the uncertainty of the forecast as bands. */

import { computed } from "@preact/signals";
import type uPlot from "uplot";
import type { ChargingPlan, Course, Forecast } from "../api/documents";
import { emptyAfterM, innerShare } from "../model/arrival";
import { interpolate } from "../model/interpolate";
import { PERCENT } from "../model/units";
import { answer, course, turn } from "../state/answer";
import { chargingPlan } from "../state/charging";
import { conditions } from "../state/conditions";
import { shownForecast, distanceM, driving, update } from "../state/drive";
import { alternative, departure } from "../state/forecast";
import { positionM } from "../state/position";
import { format, text, units, wholeBattery } from "../state/preferences";
import { alongAxis, axis, EDGE, line, percent } from "./axes";
import { type Mark, placeMarks, pointerCursor } from "./marks";
import { type ChartOptions, type Look, Plot } from "./plot";

const MIN_SPAN = 20;
const STEP = 5;
const LOWEST = -10;
const NEAR = 15;
/** Least distance between two labels [px]. */
const LABEL_PX = 18;
/** Share of the way at the start where a stop's number stands behind it, off the axis; a name is three times as wide. */
const EDGE_SHARE = 0.1;

/** A series of a forecast [%], interpolated at the distances `xs`. */
function seriesAt(of: Forecast, name: Curve, xs: number[]): number[] {
  return xs.map((x) => PERCENT.from(interpolate(x, of.series.distance_m, of.series[name])));
}

type Curve = "displayed_soc" | "displayed_soc_low" | "displayed_soc_high";

/** Distances of the forecast, with that of the car inserted. */
function distancesOf({ series }: Forecast, carM: number | null): number[] {
  if (carM === null) return series.distance_m;
  return [...series.distance_m, carM].sort((a, b) => a - b);
}

/** The columns of a course with charging stops, which are vertical lines. */
function columnsOf({ position_m, displayed_soc, low, high }: Course, share: number): uPlot.AlignedData {
  const percent = (column: number[]) => column.map(PERCENT.from);
  const core = (column: number[]) =>
    displayed_soc.map((soc, k) => PERCENT.from(soc + ((column[k] as number) - soc) * share));
  const none = position_m.map(() => null);
  const bands = [percent(high), percent(low), core(high), core(low)];
  const xs = position_m.map(units.value.distance.from);
  return [xs, ...bands, none, none, none, none, percent(displayed_soc), none];
}

const columns = computed<uPlot.AlignedData>(() => {
  const now = shownForecast.value;
  if (!now) return [[], [], [], [], [], [], [], [], [], [], []];
  if (chargingPlan.value) return columnsOf(chargingPlan.value.course, innerShare(now));
  const carM = driving.value && update.value ? distanceM.value : null;
  const xs = distancesOf(now, carM);
  const middle = seriesAt(now, "displayed_soc", xs);
  const share = innerShare(now);
  const core = (name: Curve) =>
    seriesAt(now, name, xs).map((edge, k) => {
      const y = middle[k] as number;
      return y + (edge - y) * share;
    });
  const none = xs.map(() => null);
  const other = (name: Curve) => (alternative.value ? seriesAt(alternative.value, name, xs) : none);
  return [
    xs.map(units.value.distance.from),
    seriesAt(now, "displayed_soc_high", xs),
    seriesAt(now, "displayed_soc_low", xs),
    core("displayed_soc_high"),
    core("displayed_soc_low"),
    other("displayed_soc_high"),
    other("displayed_soc_low"),
    driving.value && departure.value ? seriesAt(departure.value, "displayed_soc", xs) : none,
    other("displayed_soc"),
    middle.map((y, k) => ((xs[k] as number) >= (carM ?? 0) ? y : null)),
    middle.map((y, k) => ((xs[k] as number) <= (carM ?? -1) ? y : null)),
  ];
});

/** Range of the vertical axis [%]: it includes the bands, and the reserve when it is near. */
const span = computed<[number, number]>(() => {
  if (wholeBattery.value) return [0, 100];
  const values = columns.value.slice(1).flatMap((column) => Array.from(column)) as (number | null)[];
  const known = values.filter((value): value is number => value !== null);
  const reserve = PERCENT.from(conditions.value.reserve);
  let low = Math.min(...known);
  const high = Math.min(Math.ceil((Math.max(...known, reserve + 1) + 1) / STEP) * STEP, 100);
  if (low - reserve < NEAR) low = Math.min(low, reserve - 2);
  low = Math.max(Math.floor((low - 1) / STEP) * STEP, LOWEST);
  return [Math.min(low, high - MIN_SPAN), high];
});

/** A new array when the columns or the range change, so that the chart is drawn again. */
const data = computed<uPlot.AlignedData>(() => (span.value ? [...columns.value] : [[]]));

function options({ palette }: Look): ChartOptions {
  return {
    padding: [12, 46, 0, 0],
    cursor: pointerCursor(),
    scales: { x: { time: false }, y: { range: () => span.value } },
    axes: [
      // without stops the chart of the road stands below, with an axis for both
      { ...alongAxis(palette), ...(!chargingPlan.value && { size: 10, values: () => [] }) },
      axis({ palette, scale: "y", text: (y) => (y < 0 ? "" : percent(y)) }),
    ],
    bands: [
      { series: [1, 2], fill: palette["main-band"] },
      { series: [3, 4], fill: palette["main-core"] },
      { series: [5, 6], fill: palette["other-band"] },
    ],
    series: [
      {},
      ...Array.from({ length: 6 }, () => EDGE),
      line(palette.muted, { width: 1.5, dash: [2, 4] }),
      line(palette.other, { dash: [8, 5] }),
      line(palette.main),
      line(palette.driven, { width: 3.5 }),
    ],
  };
}

/** The label at the end of a forecast: on arrival, or where the battery is empty. */
function endMark(kind: string, of: Forecast): Mark & { y: number } {
  const { distance } = units.value;
  const { shown } = format.value;
  const emptyM = emptyAfterM(of);
  if (emptyM !== null)
    return { kind, text: shown(emptyM, distance, 0), x: distance.from(emptyM), y: 0, at: "right" };
  const end = distance.from(of.series.distance_m.at(-1) as number);
  const soc = PERCENT.from(of.soc_arrival);
  return { kind, text: shown(of.soc_arrival, PERCENT), x: end, y: soc, at: "right" };
}

/** Charging stops by their numbers, and the charge on arrival. */
function stopMarks({ stops, course }: ChargingPlan): Mark[] {
  const { distance } = units.value;
  const end = distance.from(course.position_m.at(-1) ?? 0);
  const numbers = stops.map(({ position_m, soc_leave }, k): Mark => ({
    kind: "stop",
    text: String(k + 1),
    x: distance.from(position_m),
    y: PERCENT.from(soc_leave),
    at: distance.from(position_m) < EDGE_SHARE * end ? "right" : "left",
  }));
  const soc = answer.value?.soc ?? 0;
  const shown = format.value.shown(soc, PERCENT);
  return [...numbers, { kind: "arrival", text: shown, x: end, y: PERCENT.from(soc), at: "right" }];
}

function marks(now: Forecast, carM: number | null, heightPx: number): Mark[] {
  const reserve = PERCENT.from(conditions.value.reserve);
  const { result } = text.value;
  const [low, high] = span.value;
  const marks: Mark[] = [];
  if (reserve >= low && reserve > 0) {
    marks.push({
      kind: "reserve",
      text: result.reserve(format.value.shown(conditions.value.reserve, PERCENT)),
      y: reserve,
    });
  }
  const { name = "", position_m: turnM = 0 } = turn.value ?? {};
  const at = turnM > (1 - 3 * EDGE_SHARE) * (course.value?.position_m.at(-1) ?? 0) ? "left" : "right";
  if (turn.value) marks.push({ kind: "aside", text: name, x: units.value.distance.from(turnM), at });
  if (low < 0) marks.push({ kind: "empty", text: result.empty, y: 0, at: "below" });
  if (chargingPlan.value) return [...marks, ...stopMarks(chargingPlan.value)];
  const own = endMark("arrival", now);
  marks.push(own);
  if (alternative.value) {
    const theirs = endMark("other", alternative.value);
    const spacing = ((high - low) / heightPx) * LABEL_PX;
    if (own.x === theirs.x && Math.abs(theirs.y - own.y) < spacing) {
      theirs.y = own.y + (theirs.y >= own.y ? spacing : -spacing);
    }
    marks.push(theirs);
  }
  if (carM !== null) {
    const y = interpolate(carM, now.series.distance_m, now.series.displayed_soc);
    const x = units.value.distance.from(carM);
    marks.push({ kind: "car", text: "", x, y: PERCENT.from(y) });
  }
  return marks;
}

export function BatteryChart({ height, label }: { height: number; label: string }) {
  const now = shownForecast.value as Forecast;
  const positionNowM = positionM.value;
  const carM = driving.value ? distanceM.value : null;
  return (
    <Plot
      label={label}
      data={data.value}
      height={height}
      options={options}
      variant={String(chargingPlan.value !== null)}
      pointer={positionNowM === null ? null : units.value.distance.from(positionNowM)}
      onDraw={(plot) => placeMarks(plot, marks(now, carM, plot.over.clientHeight))}
    />
  );
}
