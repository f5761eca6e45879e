/** While driving: the arrival by the forecast and by the naive gauge, made at each place. */

import { computed } from "@preact/signals";
import type uPlot from "uplot";
import { PERCENT } from "../model/units";
import { answer, arrived, history } from "../state/drive";
import { lengthM } from "../state/pointer";
import { format, text, units } from "../state/preferences";
import { axis, percent, plain } from "./axes";
import { type Mark, placeMarks } from "./marks";
import { type Look, Plot } from "./plot";

const LEAST_SPAN = 8;
/** The gauge's first guesses are wild; the picture is not stretched for them. */
const FURTHEST = 15;
const MARGIN = 1.5;

const data = computed<uPlot.AlignedData>(() => {
  const said = history.value;
  return [
    said.map((m) => units.value.distance.from(m.distanceM)),
    said.map((m) => PERCENT.from(m.high)),
    said.map((m) => PERCENT.from(m.low)),
    said.map((m) => (m.naive === null ? null : PERCENT.from(m.naive))),
    said.map((m) => PERCENT.from(m.soc)),
  ];
});

const span = computed<[number, number]>(() => {
  const said = history.value;
  const now = PERCENT.from(answer.value?.soc_arrival ?? 0.5);
  let low = Math.min(now, ...said.map((m) => PERCENT.from(m.low)));
  let high = Math.max(now, ...said.map((m) => PERCENT.from(m.high)));
  for (const { naive } of said) {
    if (naive === null) continue;
    low = Math.min(low, Math.max(PERCENT.from(naive), now - FURTHEST));
    high = Math.max(high, Math.min(PERCENT.from(naive), now + FURTHEST));
  }
  const more = Math.max((LEAST_SPAN - (high - low)) / 2, MARGIN);
  return [low - more, high + more];
});

function options({ palette, width, height }: Look): uPlot.Options {
  const edge: uPlot.Series = { stroke: "transparent", width: 0, points: { show: false } };
  return {
    width,
    height,
    padding: [12, 16, 0, 0],
    legend: { show: false },
    cursor: { show: false },
    scales: {
      x: { time: false, range: () => [0, units.value.distance.from(lengthM.value) || 1] },
      y: { range: () => span.value },
    },
    axes: [
      axis({ palette, scale: "x", grid: false, text: (x) => `${plain(x)} ${units.value.distance.unit}` }),
      axis({ palette, scale: "y", text: percent }),
    ],
    bands: [{ series: [1, 2], fill: palette.mainBand }],
    series: [
      {},
      edge,
      edge,
      { stroke: palette.other, width: 2, dash: [8, 5], points: { show: false } },
      { stroke: palette.main, width: 2.5, points: { show: false } },
    ],
  };
}

function marks(): Mark[] {
  const said = history.value.at(-1);
  if (!arrived.value || !said) return [];
  const arrivedWith = text.value.result.arrivedWith(format.value.shown(said.soc, PERCENT, 1));
  return [{ kind: "truth", text: arrivedWith, y: PERCENT.from(said.soc) }];
}

export function HistoryChart({ height, label }: { height: number; label: string }) {
  const drawn = marks();
  return (
    <Plot
      label={label}
      data={data.value}
      height={height}
      options={options}
      drawn={(plot) => placeMarks(plot, drawn)}
    />
  );
}
