import type { ComponentChildren } from "preact";
import { useId } from "preact/hooks";

interface Props<T extends string | number> {
  label: string;
  value: T;
  options: readonly (readonly [T, ComponentChildren])[];
  onChoose: (value: T) => void;
  class?: string;
  disabled?: readonly T[];
}

/** Exclusive choices side by side, as radio buttons, so that arrow keys work. */
export function Choice<T extends string | number>({
  label,
  value,
  options,
  onChoose,
  class: kind = "",
  disabled = [],
}: Props<T>) {
  const name = useId();
  return (
    <fieldset class={`choice ${kind}`} aria-label={label}>
      {options.map(([option, text]) => (
        <label key={option}>
          <input
            type="radio"
            name={name}
            value={option}
            checked={option === value}
            disabled={disabled.includes(option)}
            onChange={() => onChoose(option)}
          />
          <span>{text}</span>
        </label>
      ))}
    </fieldset>
  );
}
