import { useId } from "preact/hooks";
import type { Answer } from "../api/types";
import { interpolate } from "../model/interpolate";
import { duration, figure, PERCENT, shown } from "../model/units";
import { driving, durationS, road, seek, timeS } from "../state/drive";
import { lengthM, looked, place } from "../state/pointer";
import { units } from "../state/preferences";

const STEPS = 200;

function readout(of: Answer, atM: number): string {
  const { series } = of;
  const { distance, speed, height } = units.value;
  const at = (column: number[]) => interpolate(atM, series.distance_m, column);
  const [low, high] = [series.displayed_soc_low, series.displayed_soc_high].map((edge) =>
    figure(PERCENT.from(at(edge)), 0),
  );
  const parts = [
    `${shown(atM, distance)}, ${duration(at(series.time_s))}`,
    `battery ${shown(at(series.displayed_soc), PERCENT)} (${low} to ${high})`,
  ];
  const now = road.value;
  if (now) {
    parts.push(shown(interpolate(atM, now.distanceM, now.speedMS), speed));
    if (now.elevationM) parts.push(`${shown(interpolate(atM, now.distanceM, now.elevationM), height)} high`);
  }
  return parts.join(" · ");
}

/** A slider along the way: what the pointer does on the charts, for fingers and keys. Driving, it is the car. */
export function Place({ of }: { of: Answer }) {
  const id = useId();
  const length = lengthM.value;
  const at = place.value;
  const text = at === null ? "Move to look along the way" : readout(of, at);
  const share = driving.value ? timeS.value / (durationS.value || 1) : (at ?? 0) / (length || 1);
  return (
    <div class="place">
      <label for={id} class="unseen">
        {driving.value ? "The car along the trip" : "Place along the way"}
      </label>
      <input
        id={id}
        type="range"
        min={0}
        max={STEPS}
        step={1}
        value={Math.round(share * STEPS)}
        style={{ "--filled": String(share) }}
        aria-valuetext={text}
        onInput={(event) => {
          const part = event.currentTarget.valueAsNumber / STEPS;
          if (driving.value) seek(part * durationS.value);
          else looked.value = part * length;
        }}
      />
      <p class="readout">{text}</p>
    </div>
  );
}
