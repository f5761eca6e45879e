import { useEffect, useState } from "preact/hooks";
import { chanceOf, emptyAfterM } from "../model/arrival";
import { PERCENT } from "../model/units";
import { shownForecast } from "../state/drive";
import { requested } from "../state/forecast";
import { format, text, units } from "../state/preferences";
import { bandText, chanceInFigures } from "./wording";

/** On a phone: the result at the bottom of the screen while the chart is out of view. */
export function Glance() {
  const [isHidden, setHidden] = useState(false);
  useEffect(() => {
    const plot = document.querySelector(".result .plot");
    if (!plot) return;
    const watcher = new IntersectionObserver(([entry]) => setHidden(!entry?.isIntersecting));
    watcher.observe(plot);
    return () => watcher.disconnect();
  }, [shownForecast.value !== null]);
  const now = shownForecast.value;
  if (!now || !isHidden) return null;
  const chance = chanceOf(now, requested.value.at.reserve);
  const emptyM = emptyAfterM(now);
  const { result } = text.value;
  const { shown } = format.value;
  return (
    <div class="glance" aria-hidden="true">
      <strong>{shown(emptyM === null ? now.soc_arrival : 0, PERCENT)}</strong>
      <span>
        {emptyM === null
          ? result.glance(bandText(now))
          : result.emptyAfter(shown(emptyM, units.value.distance, 0))}
      </span>
      {chance !== null && <span>{result.glanceReserve(chanceInFigures(chance))}</span>}
    </div>
  );
}
