import { useEffect, useState } from "preact/hooks";
import { chanceOf, emptyAfterM, likelihoodOf } from "../model/arrival";
import { PERCENT } from "../model/units";
import { shownForecast, arrived, playing } from "../state/drive";
import { requested, problem } from "../state/forecast";
import { format, text, units } from "../state/preferences";
import { bandText } from "./wording";

const SETTLED_MS = 700;

function sentence(): string {
  const now = shownForecast.value;
  if (problem.value || !now) return "";
  const { result, chance } = text.value;
  const soc = format.value.shown(now.soc_arrival, PERCENT);
  if (arrived.value) return result.announcedArrival(soc);
  const emptyM = emptyAfterM(now);
  const forecast =
    emptyM === null
      ? result.announced(soc, bandText(now))
      : result.announcedEmpty(format.value.shown(emptyM, units.value.distance, 0));
  const kept = chanceOf(now, requested.value.at.reserve);
  return kept === null ? forecast : `${forecast} ${chance.announced(chance.words[likelihoodOf(kept)])}`;
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
