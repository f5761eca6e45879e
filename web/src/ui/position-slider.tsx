import { useId } from "preact/hooks";
import type { Course } from "../api/documents";
import { interpolate } from "../model/interpolate";
import { PERCENT } from "../model/units";
import { course } from "../state/answer";
import { chargingPlan } from "../state/charging";
import { driving, durationS, shownProfile, seek, timeS } from "../state/drive";
import { lengthM, selectedM, positionM } from "../state/position";
import { format, text, units } from "../state/preferences";

const STEPS = 200;

function readout(of: Course, atM: number): string {
  const { distance, speed, height } = units.value;
  const { duration, figure, shown } = format.value;
  const { result } = text.value;
  const at = (column: number[]) => interpolate(atM, of.position_m, column);
  const [low, high] = [of.low, of.high].map((edge) => figure(PERCENT.from(at(edge)), 0)) as [string, string];
  const parts = [
    `${shown(atM, distance)}, ${duration(at(of.time_s))}`,
    result.readoutBattery(shown(at(of.displayed_soc), PERCENT), low, high),
  ];
  const now = chargingPlan.value ? null : shownProfile.value;
  if (now) {
    parts.push(shown(interpolate(atM, now.distanceM, now.speedMS), speed));
    if (now.elevationM) {
      parts.push(result.readoutElevation(shown(interpolate(atM, now.distanceM, now.elevationM), height)));
    }
  }
  return parts.join(" · ");
}

/** Selects the position along the way by touch and keyboard; during a drive, it moves the car. */
export function PositionSlider() {
  const id = useId();
  const length = lengthM.value;
  const atM = positionM.value;
  const { result } = text.value;
  const of = course.value;
  const values = atM === null || !of ? result.moveSlider : readout(of, atM);
  const share = driving.value ? timeS.value / (durationS.value || 1) : (atM ?? 0) / (length || 1);
  return (
    <div class="position-slider">
      <label for={id} class="unseen">
        {driving.value ? result.car : result.position}
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
          else selectedM.value = part * length;
        }}
      />
      <p class="readout">{values}</p>
    </div>
  );
}
