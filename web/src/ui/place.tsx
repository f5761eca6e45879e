import { useId } from "preact/hooks";
import type { Answer } from "../api/types";
import { interpolate } from "../model/interpolate";
import { PERCENT } from "../model/units";
import { driving, durationS, road, seek, timeS } from "../state/drive";
import { lengthM, looked, place } from "../state/pointer";
import { format, text, units } from "../state/preferences";

const STEPS = 200;

function readout(of: Answer, atM: number): string {
  const { series } = of;
  const { distance, speed, height } = units.value;
  const { duration, figure, shown } = format.value;
  const { result } = text.value;
  const at = (column: number[]) => interpolate(atM, series.distance_m, column);
  const [low, high] = [series.displayed_soc_low, series.displayed_soc_high].map((edge) =>
    figure(PERCENT.from(at(edge)), 0),
  ) as [string, string];
  const parts = [
    `${shown(atM, distance)}, ${duration(at(series.time_s))}`,
    result.readoutBattery(shown(at(series.displayed_soc), PERCENT), low, high),
  ];
  const now = road.value;
  if (now) {
    parts.push(shown(interpolate(atM, now.distanceM, now.speedMS), speed));
    if (now.elevationM) {
      parts.push(result.readoutElevation(shown(interpolate(atM, now.distanceM, now.elevationM), height)));
    }
  }
  return parts.join(" · ");
}

/** A slider along the way: what the pointer does on the charts, for fingers and keys. Driving, it is the car. */
export function Place({ of }: { of: Answer }) {
  const id = useId();
  const length = lengthM.value;
  const at = place.value;
  const { result } = text.value;
  const values = at === null ? result.movePlace : readout(of, at);
  const share = driving.value ? timeS.value / (durationS.value || 1) : (at ?? 0) / (length || 1);
  return (
    <div class="place">
      <label for={id} class="unseen">
        {driving.value ? result.car : result.place}
      </label>
      <input
        id={id}
        type="range"
        min={0}
        max={STEPS}
        step={1}
        value={Math.round(share * STEPS)}
        style={{ "--filled": String(share) }}
        aria-valuetext={values}
        onInput={(event) => {
          const part = event.currentTarget.valueAsNumber / STEPS;
          if (driving.value) seek(part * durationS.value);
          else looked.value = part * length;
        }}
      />
      <p class="readout">{values}</p>
    </div>
  );
}
