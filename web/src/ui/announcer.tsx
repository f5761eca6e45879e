import { useEffect, useState } from "preact/hooks";
import { chanceInWords, chanceOf } from "../model/arrival";
import { PERCENT, shown } from "../model/units";
import { answer, arrived, playing } from "../state/drive";
import { asked, problem } from "../state/forecast";
import { bandText } from "./result";

const SETTLED_MS = 700;

function sentence(): string {
  if (problem.value) return "";
  const now = answer.value;
  if (!now) return "";
  const chance = chanceOf(now, asked.value.at.reserve);
  const reserve = chance === null ? "" : ` ${chanceInWords(chance)} to keep the reserve.`;
  const end = arrived.value ? "Arrived." : "Forecast:";
  return `${end} ${shown(now.soc_arrival, PERCENT)} battery on arrival, ${bandText(now)} in 9 of 10 trips.${reserve}`;
}

/** Says the result to who does not see it, once it has settled. */
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
