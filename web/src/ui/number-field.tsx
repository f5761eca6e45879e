import { useId } from "preact/hooks";
import type { Quantity } from "../model/units";

interface Props {
  label: string;
  /** In SI; null for an empty field. */
  value: number | null;
  quantity: Quantity;
  /** Digits after the decimal sign. */
  digits?: number;
  /** What is wrong with what was typed; empty for nothing. */
  fault?: string;
  onChange: (si: number | null) => void;
}

/** A value in SI as one types it; empty for none. */
export function typedText(si: number | null, quantity: Quantity, digits: number): string {
  return si === null ? "" : String(Number(quantity.from(si).toFixed(digits)));
}

/** A number with its unit. */
export function NumberField({ label, value, quantity, digits = 0, fault = "", onChange }: Props) {
  const id = useId();
  return (
    <>
      <label for={id}>{label}</label>
      <span class="with-unit">
        <input
          id={id}
          type="number"
          step="any"
          inputMode="decimal"
          value={typedText(value, quantity, digits)}
          aria-invalid={fault !== ""}
          aria-describedby={fault ? `${id}-fault` : undefined}
          onChange={({ currentTarget: { valueAsNumber: typed } }) =>
            onChange(Number.isFinite(typed) ? quantity.to(typed) : null)
          }
        />
        <span>{`\u00a0${quantity.unit}`}</span>
      </span>
      {fault && (
        <p id={`${id}-fault`} class="faults" role="alert">
          {fault}
        </p>
      )}
    </>
  );
}
