/** uPlot as a component: made once for a look, then only its data change. */

import { useLayoutEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import { dark, format, units } from "../state/preferences";
import { pointAt } from "./marks";
import { type Palette, paletteOf } from "./palette";

export interface Look {
  palette: Palette;
  width: number;
  height: number;
}

interface Props {
  /** The picture in words. */
  label: string;
  data: uPlot.AlignedData;
  height: number;
  /** Options of uPlot; asked again when theme, units or `variant` change. */
  options: (look: Look) => uPlot.Options;
  variant?: string;
  /** Place of the cursor on the x axis; null for none. */
  pointer?: number | null;
  /** After every drawing, to place what stands on top. */
  drawn?: (plot: uPlot) => void;
}

export function Plot({ label, data, height, options, variant = "", pointer = null, drawn }: Props) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const given = useRef(data);
  const look = `${dark.value} ${format.value.locale} ${units.value.distance.unit} ${variant} ${height}`;

  const onTop = useRef<(plot: uPlot) => void>(() => undefined);
  onTop.current = (made) => {
    drawn?.(made);
    pointAt(made, pointer);
  };

  // New data are given to the plot below, not to a new plot.
  useLayoutEffect(() => {
    const element = box.current as HTMLDivElement;
    const width = () => Math.max(element.clientWidth, 120);
    const asked = options({ palette: paletteOf(element), width: width(), height });
    const made = new uPlot(
      { ...asked, hooks: { draw: [(drawing) => onTop.current(drawing)] } },
      data,
      element,
    );
    plot.current = made;
    given.current = data;
    const watcher = new ResizeObserver(() => {
      if (made.width !== width()) made.setSize({ width: width(), height });
    });
    watcher.observe(element);
    void document.fonts.ready.then(() => plot.current === made && made.redraw(false, true));
    return () => {
      watcher.disconnect();
      made.destroy();
      plot.current = null;
    };
  }, [look]);

  useLayoutEffect(() => {
    const made = plot.current;
    if (!made) return;
    if (given.current === data) onTop.current(made);
    else made.setData(data);
    given.current = data;
  });

  return <div class="plot" ref={box} role="img" aria-label={label} />;
}
