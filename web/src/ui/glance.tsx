import { useEffect, useState } from "preact/hooks";
import { chanceInFigures, chanceOf } from "../model/arrival";
import { PERCENT, shown } from "../model/units";
import { answer } from "../state/drive";
import { asked } from "../state/forecast";
import { bandText } from "./result";

/** On a phone: the result at the foot while its picture is out of sight. What it says stands in the picture's card too. */
export function Glance() {
  const [away, setAway] = useState(false);
  useEffect(() => {
    const headline = document.querySelector(".result .plot");
    if (!headline) return;
    const watcher = new IntersectionObserver(([entry]) => setAway(!entry?.isIntersecting));
    watcher.observe(headline);
    return () => watcher.disconnect();
  }, [answer.value !== null]);
  const now = answer.value;
  if (!now || !away) return null;
  const chance = chanceOf(now, asked.value.at.reserve);
  return (
    <div class="glance" aria-hidden="true">
      <strong>{shown(now.soc_arrival, PERCENT)}</strong>
      <span>on arrival, {bandText(now)}</span>
      {chance !== null && <span>reserve: {chanceInFigures(chance)}</span>}
    </div>
  );
}
