import { useEffect, useState } from "preact/hooks";
import { emptyAfterM, likelihoodOf } from "../model/arrival";
import { PERCENT } from "../model/units";
import { answer, isLate, isLookingForStops, stopInDoubt } from "../state/answer";
import { chargingPlan } from "../state/charging";
import { shownForecast, arrived, playing } from "../state/drive";
import { problem } from "../state/forecast";
import { format, text, units } from "../state/preferences";
import { rangeWithUnit } from "./wording";

const SETTLED_MS = 700;

function sentence(): string {
  const of = shownForecast.value;
  const now = answer.value;
  if (problem.value || !of || !now || isLate.value || isLookingForStops.value) return "";
  const { result, chance } = text.value;
  const soc = format.value.shown(now.soc, PERCENT);
  if (arrived.value) return result.announcedArrival(soc);
  const emptyM = chargingPlan.value ? null : emptyAfterM(of);
  const forecast =
    emptyM === null
      ? result.announced(soc, rangeWithUnit(now.interval, PERCENT))
      : result.announcedEmpty(format.value.shown(emptyM, units.value.distance, 0));
  if (now.pReserve === null || stopInDoubt.value) return forecast;
  return `${forecast} ${chance.announced(chance.words[likelihoodOf(now.pReserve)])}`;
}

/** The result in a live region, after it has been stable for `SETTLED_MS`. */
export function Announcer() {
  const [announced, setAnnounced] = useState("");
  const next = playing.value ? announced : sentence();
  useEffect(() => {
    const timer = setTimeout(() => setAnnounced(next), SETTLED_MS);
    return () => clearTimeout(timer);
  }, [next]);
  return (
    <p class="unseen" role="status" aria-live="polite">
      {announced}
    </p>
  );
}
