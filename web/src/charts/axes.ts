/** Axes and series that the charts share. */

import type uPlot from "uplot";
import { PERCENT } from "../model/units";
import { format, units } from "../state/preferences";
import type { Palette } from "./palette";

// eslint-disable-next-line page/text -- a font
const FONT = '12px "Inter Variable", system-ui, sans-serif';

/** An invisible series: one edge of a band. */
export const EDGE: uPlot.Series = { stroke: "transparent", width: 0, points: { show: false } };

/** A line; `width` in pixels. */
export function line(stroke: string, more: Partial<uPlot.Series> = {}): uPlot.Series {
  return { stroke, width: 2.5, points: { show: false }, ...more };
}

interface AxisOptions {
  palette: Palette;
  scale: string;
  side?: 1 | 2 | 3;
  grid?: boolean;
  /** Text of a tick. */
  text: (value: number) => string;
  space?: number;
}

export function axis(of: AxisOptions): uPlot.Axis {
  return {
    scale: of.scale,
    side: of.side ?? (of.scale === "x" ? 2 : 3),
    stroke: of.palette.muted,
    font: FONT,
    gap: 6,
    size: of.scale === "x" ? 30 : 46,
    space: of.space ?? (of.scale === "x" ? 70 : 42),
    grid: { show: of.grid ?? true, stroke: of.palette.grid, width: 1 },
    ticks: { show: false },
    values: (_plot, splits) => splits.map(of.text),
  };
}

/** The axis of the distance along the way. */
export function alongAxis(palette: Palette): uPlot.Axis {
  return axis({ palette, scale: "x", grid: false, text: (x) => `${plain(x)} ${units.value.distance.unit}` });
}

/** A tick with at most two digits after the decimal sign. */
export function plain(value: number): string {
  return format.value.plain(value, 2);
}

/** A tick of a value in percent. */
export function percent(value: number): string {
  return `${plain(value)}\u00a0${PERCENT.unit}`;
}
