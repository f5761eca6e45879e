/** Arrival history: the charge on arrival by forecast and naive gauge, as forecast at each position of the drive. */

import { computed } from "@preact/signals";
import type uPlot from "uplot";
import { PERCENT } from "../model/units";
import { shownForecast, arrived, history } from "../state/drive";
import { lengthM } from "../state/position";
import { format, text, units } from "../state/preferences";
import { alongAxis, axis, EDGE, line, percent } from "./axes";
import { type Mark, placeMarks } from "./marks";
import { type ChartOptions, type Look, Plot } from "./plot";

const MIN_SPAN = 8;
/** The range does not follow the naive gauge further than this [%]: its first values are far off. */
const MAX_DISTANCE = 15;
const MARGIN = 1.5;

const data = computed<uPlot.AlignedData>(() => {
  const points = history.value;
  return [
    points.map((m) => units.value.distance.from(m.distanceM)),
    points.map((m) => PERCENT.from(m.high)),
    points.map((m) => PERCENT.from(m.low)),
    points.map((m) => (m.naive === null ? null : PERCENT.from(m.naive))),
    points.map((m) => PERCENT.from(m.soc)),
  ];
});

const span = computed<[number, number]>(() => {
  const points = history.value;
  const now = PERCENT.from(shownForecast.value?.soc_arrival ?? 0.5);
  let low = Math.min(now, ...points.map((m) => PERCENT.from(m.low)));
  let high = Math.max(now, ...points.map((m) => PERCENT.from(m.high)));
  for (const { naive } of points) {
    if (naive === null) continue;
    low = Math.min(low, Math.max(PERCENT.from(naive), now - MAX_DISTANCE));
    high = Math.max(high, Math.min(PERCENT.from(naive), now + MAX_DISTANCE));
  }
  const more = Math.max((MIN_SPAN - (high - low)) / 2, MARGIN);
  return [low - more, high + more];
});

function options({ palette }: Look): ChartOptions {
  return {
    padding: [12, 16, 0, 0],
    scales: {
      x: { time: false, range: () => [0, units.value.distance.from(lengthM.value) || 1] },
      y: { range: () => span.value },
    },
    axes: [alongAxis(palette), axis({ palette, scale: "y", text: percent })],
    bands: [{ series: [1, 2], fill: palette["main-band"] }],
    series: [{}, EDGE, EDGE, line(palette.other, { width: 2, dash: [8, 5] }), line(palette.main)],
  };
}

function marks(): Mark[] {
  const last = history.value.at(-1);
  if (!arrived.value || !last) return [];
  const arrivedWith = text.value.result.arrivedWith(format.value.shown(last.soc, PERCENT, 1));
  return [{ kind: "truth", text: arrivedWith, y: PERCENT.from(last.soc) }];
}

export function HistoryChart({ height, label }: { height: number; label: string }) {
  const drawn = marks();
  return (
    <Plot
      label={label}
      data={data.value}
      height={height}
      options={options}
      onDraw={(plot) => placeMarks(plot, drawn)}
    />
  );
}
