/** What all charts share: type, grid, room for labels. */

import type uPlot from "uplot";
import { PERCENT } from "../model/units";
import { format } from "../state/preferences";
import type { Palette } from "./palette";

// eslint-disable-next-line page/text -- a font
const FONT = '12px "Inter Variable", system-ui, sans-serif';

interface AxisOf {
  palette: Palette;
  scale: string;
  side?: 1 | 2 | 3;
  grid?: boolean;
  /** Text of a tick. */
  text: (value: number) => string;
  /** Room across the axis. */
  size?: number;
  space?: number;
}

export function axis(of: AxisOf): uPlot.Axis {
  return {
    scale: of.scale,
    side: of.side ?? (of.scale === "x" ? 2 : 3),
    stroke: of.palette.muted,
    font: FONT,
    gap: 6,
    size: of.size ?? (of.scale === "x" ? 30 : 46),
    space: of.space ?? (of.scale === "x" ? 70 : 42),
    grid: { show: of.grid ?? true, stroke: of.palette.grid, width: 1 },
    ticks: { show: false },
    values: (_plot, splits) => splits.map(of.text),
  };
}

/** Ticks without more digits than their distance needs. */
export function plain(value: number): string {
  return format.value.plain(value, 2);
}

/** A tick that is in percent already. */
export function percent(value: number): string {
  return `${plain(value)}\u00a0${PERCENT.unit}`;
}
