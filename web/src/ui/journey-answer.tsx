import type { Journey } from "../api/documents";
import { chanceOf } from "../model/arrival";
import { PERCENT } from "../model/units";
import { chooseRoad, leaving, leavingIsOld, requested } from "../state/forecast";
import { answersAreOld, chosenRoad, journey } from "../state/journey";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";
import { Choice } from "./choice";
import { chanceInFigures } from "./wording";

/** What a road is, such as "fastest"; a number where the service gives no label. */
function labelOf({ roads }: Journey, index: number): string {
  const { journey: words } = text.value;
  const names: Record<string, string> = words.labels;
  const labels = (roads[index]?.labels ?? []).map((label) => names[label] ?? label);
  return labels.join(", ") || words.road(index + 1);
}

/** The roads of a journey to choose from, with time, distance and charge on arrival of each. */
function Roads({ of }: { of: Journey }) {
  const { duration, shown } = format.value;
  if (of.roads.length < 2) return null;
  const options = of.roads.map(({ distance_m, forecast }, k) => {
    const time = forecast.series.time_s.at(-1) as number;
    const chance = chanceOf(forecast, requested.value.at.reserve);
    const detail = `${duration(time)} · ${shown(distance_m, units.value.distance)} · ${shown(forecast.soc_arrival, PERCENT)}`;
    return [
      String(k),
      <>
        <b>{labelOf(of, k)}</b> <small>{detail}</small>
        {chance !== null && <small class="unseen">{chanceInFigures(chance)}</small>}
      </>,
    ] as const;
  });
  return (
    <Choice
      label={text.value.journey.roads}
      class="roads"
      value={String(chosenRoad.value)}
      options={options}
      onChoose={(road) => chooseRoad(Number(road))}
    />
  );
}

/** The charge to leave with in words; rounded up. */
function leaveText(needed: number): string {
  const { shown } = format.value;
  const { journey: words } = text.value;
  const upwards = (soc: number) => shown(Math.ceil(soc * 100 - 1e-6) / 100, PERCENT);
  if (needed > 1) return words.notEnough(upwards(needed - 1));
  return needed > 0 ? words.leaveWith(upwards(needed)) : words.anyCharge;
}

/** The charge to leave with on a trip that is no journey. */
export function LeaveAnswer() {
  const leave = leaving.value;
  if (!leave || trip.value?.stops) return null;
  return (
    <div class={`journey-answer${leavingIsOld.value ? " old" : ""}`} aria-busy={leavingIsOld.value}>
      <p>{leaveText(leave.soc_needed)}</p>
    </div>
  );
}

/** What a driver asks of a journey. */
export function JourneyAnswer() {
  const answer = journey.value;
  if (!answer || !trip.value?.stops) return null;
  const { shown, span } = format.value;
  const { journey: words } = text.value;
  const { charging: stop, soc_needed: needed, motorway_speed_m_s: speed } = answer;
  return (
    <div class={`journey-answer${answersAreOld.value ? " old" : ""}`} aria-busy={answersAreOld.value}>
      <p>{leaveText(needed)}</p>
      {speed !== null && <p>{words.atMost(shown(speed, units.value.speed, 0))}</p>}
      {stop && (
        <p>
          {words.charge(
            stop.station.name || words.station,
            span(stop.charging_s),
            shown(stop.soc_arrival, PERCENT),
            shown(stop.soc_leave, PERCENT),
          )}
        </p>
      )}
      <Roads of={answer} />
    </div>
  );
}
