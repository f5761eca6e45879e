import type { Answer } from "../api/types";
import { ArrivalChart } from "../charts/arrival";
import { chanceInFigures, chanceOf, DOTS, equallyLikely } from "../model/arrival";
import { PERCENT, shown } from "../model/units";
import { conditions } from "../state/conditions";
import { answer, driving } from "../state/drive";
import { alternative, mode } from "../state/forecast";
import { Causes } from "./causes";
import { DriveCard } from "./drive";
import { ArrivalTable } from "./tables";

function Arrival({ of }: { of: Answer }) {
  const { reserve } = conditions.value;
  const kept = equallyLikely(of).filter((soc) => soc >= reserve).length;
  const chance = chanceOf(of, reserve);
  const said = `${kept} of ${DOTS} equally likely arrivals keep the reserve of ${shown(reserve, PERCENT)}`;
  return (
    <section class="card arrival-card" aria-labelledby="arrival-title">
      <h2 id="arrival-title">Battery on arrival</h2>
      <p class="note">Each dot is one of {DOTS} equally likely trips.</p>
      <ArrivalChart answer={of} reserve={reserve} height={190} label={said} />
      <p class="said">
        {said}
        {chance !== null && `; computed exactly, ${chanceInFigures(chance)}`}.
      </p>
      <ArrivalTable of={of} />
    </section>
  );
}

export function Details() {
  const now = answer.value;
  if (!now) return null;
  return (
    <div class="details">
      {driving.value && <DriveCard />}
      <Causes of={now} other={mode.value === "compare" ? alternative.value : null} />
      <Arrival of={now} />
    </div>
  );
}
