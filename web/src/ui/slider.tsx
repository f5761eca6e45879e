import { useId } from "preact/hooks";
import type { Fault } from "../api/types";
import type { Quantity } from "../model/units";
import { format } from "../state/preferences";
import { FaultList } from "./faults";

interface Props {
  label: string;
  /** In SI. */
  value: number;
  least: number;
  most: number;
  /** In what is shown. */
  step: number;
  quantity: Quantity;
  faults?: Fault[] | undefined;
  onChange: (value: number) => void;
}

/** A value that the picture follows. */
export function Slider({ label, value, least, most, step, quantity, faults = [], onChange }: Props) {
  const id = useId();
  const low = Math.round(quantity.from(least) / step) * step;
  const high = Math.round(quantity.from(most) / step) * step;
  const now = quantity.from(value);
  const { shown } = format.value;
  const filled = Math.min(Math.max((now - low) / (high - low), 0), 1);
  return (
    <div class="slider">
      <label for={id}>{label}</label>
      <output for={id}>{shown(value, quantity)}</output>
      <input
        id={id}
        type="range"
        min={low}
        max={high}
        step={step}
        value={now}
        style={{ "--filled": String(filled) }}
        aria-valuetext={shown(value, quantity)}
        aria-invalid={faults.length > 0}
        aria-describedby={faults.length > 0 ? `${id}-faults` : undefined}
        onInput={(event) => onChange(quantity.to(event.currentTarget.valueAsNumber))}
      />
      <FaultList id={`${id}-faults`} faults={faults} />
    </div>
  );
}
