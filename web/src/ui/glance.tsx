import { useEffect, useState } from "preact/hooks";
import { chanceOf } from "../model/arrival";
import { PERCENT } from "../model/units";
import { answer } from "../state/drive";
import { asked } from "../state/forecast";
import { format, text } from "../state/preferences";
import { bandText, chanceInFigures } from "./wording";

/** On a phone: the result at the foot while its picture is out of sight. The card of the picture has it too. */
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
  const { result } = text.value;
  return (
    <div class="glance" aria-hidden="true">
      <strong>{format.value.shown(now.soc_arrival, PERCENT)}</strong>
      <span>{result.glance(bandText(now))}</span>
      {chance !== null && <span>{result.glanceReserve(chanceInFigures(chance))}</span>}
    </div>
  );
}
