import { useId } from "preact/hooks";
import type { Fault } from "../api/documents";
import { format } from "../state/preferences";
import { FaultList } from "./faults";
import { type SettingName, settingOf } from "./settings";

interface Props {
  setting: SettingName;
  label: string;
  /** Whether the label stands above already. */
  isTitled?: boolean;
  /** In SI. */
  value: number;
  faults?: Fault[] | undefined;
  onChange: (value: number) => void;
}

/** A value in SI without the rounding error of its conversion, which may also lead out of the limits. */
function exact(si: number, [low, high]: readonly [number, number]): number {
  return Math.min(Math.max(Number(si.toPrecision(12)), low), high);
}

/** A slider for a setting, with its value and its faults. */
export function Slider({ setting, label, isTitled = false, value, faults = [], onChange }: Props) {
  const id = useId();
  const { quantity, limits, step } = settingOf(setting);
  const [low, high] = limits.map((si) => Math.round(quantity.from(si) / step) * step) as [number, number];
  const now = quantity.from(value);
  const shown = format.value.shown(value, quantity);
  const filled = Math.min(Math.max((now - low) / (high - low), 0), 1);
  return (
    <div class="slider">
      <label for={id} class={isTitled ? "unseen" : ""}>
        {label}
      </label>
      <output for={id}>{shown}</output>
      <input
        id={id}
        type="range"
        min={low}
        max={high}
        step={step}
        value={now}
        style={{ "--filled": String(filled) }}
        aria-valuetext={shown}
        aria-invalid={faults.length > 0}
        aria-describedby={faults.length > 0 ? `${id}-faults` : undefined}
        onInput={(event) => onChange(exact(quantity.to(event.currentTarget.valueAsNumber), limits))}
      />
      <FaultList id={`${id}-faults`} faults={faults} />
    </div>
  );
}
