/** Speed and elevation along the way. */

import { computed } from "@preact/signals";
import type uPlot from "uplot";
import { interpolate } from "../model/interpolate";
import { shownProfile } from "../state/drive";
import { positionM } from "../state/position";
import { units } from "../state/preferences";
import { alongAxis, axis, line, plain } from "./axes";
import { pointerCursor } from "./marks";
import { type ChartOptions, type Look, Plot } from "./plot";

const MIN_HEIGHT_RANGE_M = 60;
/** The chart has so many points; the speed is the mean over `WINDOW` of them: single stops would fill the chart. */
const [POINTS, WINDOW] = [100, 8];

const data = computed<uPlot.AlignedData>(() => {
  const now = shownProfile.value;
  if (!now) return [[], [], []];
  const { distance, speed, height } = units.value;
  const stepM = (now.distanceM.at(-1) ?? 0) / POINTS;
  const ends = Array.from({ length: POINTS + 1 }, (_, k) => k * stepM);
  const along = (column: Float64Array) => ends.map((x) => interpolate(x, now.distanceM, column));
  const times = along(now.timeS);
  const means = times.map((_, k) => {
    const first = Math.min(Math.max(k - WINDOW / 2, 0), POINTS - WINDOW);
    return (WINDOW * stepM) / ((times[first + WINDOW] as number) - (times[first] as number));
  });
  return [
    ends.map(distance.from),
    means.map(speed.from),
    now.elevationM ? along(now.elevationM).map(height.from) : ends.map(() => null),
  ];
});

/** Range of the elevation axis; at least `MIN_HEIGHT_RANGE_M`, so that small hills stay small. */
function heights(_plot: uPlot, low: number | null, high: number | null): [number, number] {
  if (low === null || high === null) return [0, 1];
  const room = Math.max(high - low, units.value.height.from(MIN_HEIGHT_RANGE_M));
  const bottom = low - room * 0.15;
  return [bottom, bottom + room * 2.2];
}

function optionsFor(hilly: boolean) {
  return ({ palette }: Look): ChartOptions => ({
    padding: [10, hilly ? 0 : 46, 0, 0],
    cursor: pointerCursor(),
    scales: {
      x: { time: false },
      speed: { range: (_plot, _low, high) => [0, Math.max(high ?? 0, 10) * 1.1] },
      height: { range: heights },
    },
    axes: [
      alongAxis(palette),
      axis({ palette, scale: "speed", text: plain, space: 30 }),
      { ...axis({ palette, scale: "height", side: 1, grid: false, text: plain, space: 30 }), show: hilly },
    ],
    series: [
      {},
      line(palette.speed, { scale: "speed", width: 1.25 }),
      line(palette["ground-line"], { scale: "height", fill: palette.ground, width: 1.25 }),
    ],
  });
}

export function RoadChart({ height, label }: { height: number; label: string }) {
  const hilly = shownProfile.value?.elevationM != null;
  const positionNowM = positionM.value;
  return (
    <Plot
      label={label}
      data={data.value}
      height={height}
      variant={hilly ? "hilly" : "flat"}
      options={optionsFor(hilly)}
      pointer={positionNowM === null ? null : units.value.distance.from(positionNowM)}
    />
  );
}
