/** Labels and lines on top of a chart, as elements: sharp, themed, and readable to tests and assistive tools. */

import type uPlot from "uplot";

export interface Mark {
  /** Its class is `mark mark-<kind>`. */
  kind: string;
  text: string;
  x?: number;
  y?: number;
  /** Scale of `y`. */
  scale?: string;
  /** Which side of the point the text stands on. */
  at?: "above" | "below" | "left" | "right";
}

/** Replace the marks of a chart. A mark with `x` alone is a vertical line, with `y` alone a horizontal one. */
export function placeMarks(plot: uPlot, marks: Mark[]): void {
  for (const old of plot.over.querySelectorAll(".mark")) old.remove();
  for (const mark of marks) {
    const element = document.createElement("div");
    // eslint-disable-next-line page/text -- classes
    element.className = `mark mark-${mark.kind} mark-${mark.at ?? "above"}`;
    const text = document.createElement("span");
    text.textContent = mark.text;
    element.append(text);
    if (mark.x !== undefined) element.style.left = `${plot.valToPos(mark.x, "x")}px`;
    if (mark.y !== undefined) element.style.top = `${plot.valToPos(mark.y, mark.scale ?? "y")}px`;
    element.classList.toggle("mark-line-x", mark.y === undefined);
    element.classList.toggle("mark-line-y", mark.x === undefined);
    plot.over.append(element);
  }
}

/** A cursor where the reader points; `said` gets the place in units of the chart. */
export function pointing(said: (x: number | null) => void): uPlot.Cursor {
  return {
    y: false,
    points: { show: false },
    drag: { x: false, y: false, setScale: false },
    bind: {
      mousemove: (plot, _target, handle) => (event) => {
        handle(event);
        const x = plot.posToVal(plot.cursor.left ?? -1, "x");
        said((plot.cursor.left ?? -1) >= 0 ? x : null);
        return null;
      },
      mouseleave: (_plot, _target, handle) => (event) => {
        handle(event);
        said(null);
        return null;
      },
    },
  };
}

/** Stand the cursor of a chart at `x`. */
export function pointAt(plot: uPlot, x: number | null): void {
  const left = x === null ? -10 : plot.valToPos(x, "x");
  plot.setCursor({ left, top: x === null ? -10 : plot.over.clientHeight / 2 }, false);
}
