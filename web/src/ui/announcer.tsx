import { useEffect, useState } from "preact/hooks";
import { chanceOf, likelihoodOf } from "../model/arrival";
import { PERCENT } from "../model/units";
import { answer, arrived, playing } from "../state/drive";
import { asked, problem } from "../state/forecast";
import { format, text } from "../state/preferences";
import { bandText } from "./wording";

const SETTLED_MS = 700;

function sentence(): string {
  const now = answer.value;
  if (problem.value || !now) return "";
  const { result, chance } = text.value;
  const soc = format.value.shown(now.soc_arrival, PERCENT);
  if (arrived.value) return result.announcedArrival(soc);
  const forecast = result.announced(soc, bandText(now));
  const found = chanceOf(now, asked.value.at.reserve);
  return found === null ? forecast : `${forecast} ${chance.announced(chance.words[likelihoodOf(found)])}`;
}

/** The result in a live region, once it has settled. */
export function Announcer() {
  const [said, say] = useState("");
  const next = playing.value ? said : sentence();
  useEffect(() => {
    const timer = setTimeout(() => say(next), SETTLED_MS);
    return () => clearTimeout(timer);
  }, [next]);
  return (
    <p class="unseen" role="status" aria-live="polite">
      {said}
    </p>
  );
}
