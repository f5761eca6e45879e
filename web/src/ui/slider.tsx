import { useId } from "preact/hooks";
import type { Fault } from "../api/documents";
import { format } from "../state/preferences";
import { FaultList } from "./faults";
import { type SettingName, SETTINGS } from "./settings";

interface Props {
  setting: SettingName;
  label: string;
  /** In SI. */
  value: number;
  faults?: Fault[] | undefined;
  onChange: (value: number) => void;
}

/** A slider for a setting, with its value and its faults. */
export function Slider({ setting, label, value, faults = [], onChange }: Props) {
  const id = useId();
  const { quantity: quantityOf, limits, step, exact = (si) => si } = SETTINGS[setting];
  const quantity = quantityOf();
  const [low, high] = limits.map((si) => Math.round(quantity.from(si) / step) * step) as [number, number];
  const now = quantity.from(value);
  const shown = format.value.shown(value, quantity);
  const filled = Math.min(Math.max((now - low) / (high - low), 0), 1);
  return (
    <div class="slider">
      <label for={id}>{label}</label>
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
        onInput={(event) => onChange(exact(quantity.to(event.currentTarget.valueAsNumber)))}
      />
      <FaultList id={`${id}-faults`} faults={faults} />
    </div>
  );
}
