/** Labels and lines on top of a chart, as elements of the document: styled by CSS, readable by tests and assistive tools. */

import type uPlot from "uplot";
import { selectedM } from "../state/position";
import { units } from "../state/preferences";

export interface Mark {
  /** Its class is `mark mark-<kind>`. */
  kind: string;
  text: string;
  x?: number;
  y?: number;
  /** Side of the point on which the text is placed. */
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
    if (mark.y !== undefined) element.style.top = `${plot.valToPos(mark.y, "y")}px`;
    element.classList.toggle("mark-line-x", mark.y === undefined);
    element.classList.toggle("mark-line-y", mark.x === undefined);
    plot.over.append(element);
  }
}

/** A cursor that follows the pointer, whose position along the way it selects. */
export function pointerCursor(): uPlot.Cursor {
  return {
    y: false,
    points: { show: false },
    drag: { x: false, y: false, setScale: false },
    bind: {
      mousemove: (plot, _target, handle) => (event) => {
        handle(event);
        const left = plot.cursor.left ?? -1;
        selectedM.value = left >= 0 ? units.value.distance.to(plot.posToVal(left, "x")) : null;
        return null;
      },
      mouseleave: (_plot, _target, handle) => (event) => {
        handle(event);
        selectedM.value = null;
        return null;
      },
    },
  };
}

/** Move the cursor of a chart to `x`; null hides it. */
export function moveCursor(plot: uPlot, x: number | null): void {
  const left = x === null ? -10 : plot.valToPos(x, "x");
  plot.setCursor({ left, top: x === null ? -10 : plot.over.clientHeight / 2 }, false);
}
