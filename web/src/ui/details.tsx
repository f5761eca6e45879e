import type { Forecast } from "../api/documents";
import { ArrivalChart } from "../charts/arrival";
import { chanceAtAll, chanceOf, DOTS } from "../model/arrival";
import { PERCENT } from "../model/units";
import { chargingPlan } from "../state/charging";
import { source } from "../state/catalogue";
import { shownForecast, arrived, driving } from "../state/drive";
import { alternative, requested, mode } from "../state/forecast";
import { format, text } from "../state/preferences";
import { Causes } from "./causes";
import { DriveCard } from "./drive";
import { ArrivalTable } from "./tables";
import { chanceInFigures } from "./wording";

function ArrivalDots({ of, shared, name }: { of: Forecast; shared: Forecast[]; name: string }) {
  const { reserve } = requested.value.at;
  const chance = chanceOf(of, reserve);
  const { arrival } = text.value;
  const sentence =
    chance === null ? "" : arrival.kept(format.value.shown(reserve, PERCENT), chanceInFigures(chance));
  const isOther = of !== shared[0];
  return (
    <>
      {name && <h3 class={isOther ? "is-other" : ""}>{name}</h3>}
      <ArrivalChart
        forecast={of}
        shared={shared}
        isOther={isOther}
        reserve={reserve}
        height={shared.length > 1 ? 150 : 190}
        label={sentence}
      />
      <p class="outcomes">
        {sentence} {reserve > 0 && `${text.value.chance.atAll(chanceInFigures(chanceAtAll(of)))}.`}
      </p>
    </>
  );
}

function Arrival({ of, other }: { of: Forecast; other: Forecast | null }) {
  const shared = other ? [of, other] : [of];
  const { arrival, compare, result } = text.value;
  return (
    <section class="card arrival-card" aria-labelledby="arrival-title">
      <h2 id="arrival-title">{result.onArrival}</h2>
      <p class="note">{arrival.dots(DOTS)}</p>
      {shared.map((one, k) => (
        <ArrivalDots key={k} of={one} shared={shared} name={other ? (compare.sides[k] as string) : ""} />
      ))}
      <ArrivalTable of={of} />
    </section>
  );
}

export function Details() {
  const now = shownForecast.value;
  if (!now || source.value === "distance") return null;
  const hasArrival = !(driving.value && arrived.value) && !chargingPlan.value;
  const other = mode.value === "compare" ? alternative.value : null;
  return (
    <div class="details">
      {driving.value && <DriveCard />}
      <Causes of={chargingPlan.value ?? now} road={now} other={chargingPlan.value ? null : other} />
      {hasArrival && <Arrival of={now} other={other} />}
    </div>
  );
}
