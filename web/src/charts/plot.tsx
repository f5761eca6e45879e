/** uPlot as a component: a new plot for a new look, new data for the same plot otherwise. */

import { useLayoutEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import { dark, format, system } from "../state/preferences";
import { moveCursor } from "./marks";
import { type Palette, paletteFrom } from "./palette";

export interface Look {
  palette: Palette;
  width: number;
}

export type ChartOptions = Omit<uPlot.Options, "width" | "height">;

interface Props {
  /** Text alternative of the chart. */
  label: string;
  data: uPlot.AlignedData;
  height: number;
  /** Options of uPlot; evaluated again when theme, units or `variant` change. */
  options: (look: Look) => ChartOptions;
  variant?: string;
  /** Position of the cursor on the x axis; null for none. */
  pointer?: number | null;
  /** Called after each drawing, to place the marks. */
  onDraw?: (plot: uPlot) => void;
}

export function Plot({ label, data, height, options, variant = "", pointer = null, onDraw: drawn }: Props) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const shownData = useRef(data);
  const look = `${dark.value} ${format.value.locale} ${system.value} ${variant} ${height}`;

  const onTop = useRef<(plot: uPlot) => void>(() => undefined);
  onTop.current = (created) => {
    drawn?.(created);
    moveCursor(created, pointer);
  };

  // The next effect sets new data, so that this one depends on the look alone.
  useLayoutEffect(() => {
    const element = box.current as HTMLDivElement;
    const width = () => Math.max(element.clientWidth, 120);
    const shared = { width: width(), height, legend: { show: false }, cursor: { show: false } };
    const own = options({ palette: paletteFrom(element), width: shared.width });
    const hooks = { draw: [(drawing: uPlot) => onTop.current(drawing)] };
    const created = new uPlot({ ...shared, ...own, hooks }, data, element);
    plot.current = created;
    shownData.current = data;
    const watcher = new ResizeObserver(() => {
      if (created.width !== width()) created.setSize({ width: width(), height });
    });
    watcher.observe(element);
    void document.fonts.ready.then(() => plot.current === created && created.redraw(false, true));
    return () => {
      watcher.disconnect();
      created.destroy();
      plot.current = null;
    };
  }, [look]);

  useLayoutEffect(() => {
    const created = plot.current;
    if (!created) return;
    if (shownData.current === data) onTop.current(created);
    else created.setData(data);
    shownData.current = data;
  });

  return <div class="plot" ref={box} role="img" aria-label={label} />;
}
