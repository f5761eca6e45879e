import { useEffect, useState } from "preact/hooks";
import { emptyAfterM } from "../model/arrival";
import { PERCENT } from "../model/units";
import { answer, isLate, isLookingForStops, lowestStop } from "../state/answer";
import { chargingPlan } from "../state/charging";
import { source } from "../state/catalogue";
import { shownForecast } from "../state/drive";
import { format, text, units } from "../state/preferences";
import { bandText, chanceInFigures, stationName } from "./wording";

/** On a phone: the result at the bottom of the screen while the verdict is out of view. */
export function Glance() {
  const [isHidden, setHidden] = useState(false);
  useEffect(() => {
    const card = document.querySelector(".verdict");
    if (!card) return;
    const watcher = new IntersectionObserver(([entry]) => setHidden(!entry?.isIntersecting));
    watcher.observe(card);
    return () => watcher.disconnect();
  }, [shownForecast.value !== null]);
  const of = shownForecast.value;
  const now = answer.value;
  if (!of || !now || !isHidden || isLookingForStops.value || source.value === "distance") return null;
  const stop = lowestStop.value;
  const emptyM = chargingPlan.value ? null : emptyAfterM(of);
  const { chance, result, verdict } = text.value;
  const { shown } = format.value;
  const interval = bandText(stop?.soc_interval ?? now.interval);
  if (isLate.value) return <div class="glance">{verdict.calculating}</div>;
  return (
    <div class="glance" aria-hidden="true">
      <strong>{shown(emptyM === null ? (stop?.soc_arrival ?? now.soc) : 0, PERCENT)}</strong>
      <span>
        {emptyM === null
          ? result.glance(interval, stop && stationName(stop.station))
          : result.emptyAfter(shown(emptyM, units.value.distance, 0))}
      </span>
      <span>{chance.atAll(chanceInFigures(now.pArrive))}</span>
    </div>
  );
}
