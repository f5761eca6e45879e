interface Props<T extends string> {
  label: string;
  /** Whether the label is for assistive tools only. */
  isBare?: boolean;
  /** Name in a form that reads its fields itself. */
  name?: string;
  value: T;
  options: readonly (readonly [T, string])[];
  onChoose?: (value: T) => void;
}

/** One of a few words, with its label. */
export function Select<T extends string>({
  label,
  isBare = false,
  name,
  value,
  options,
  onChoose,
}: Props<T>) {
  return (
    <label class={isBare ? "" : "field"}>
      {!isBare && <span>{label}</span>}
      <select
        name={name}
        value={value}
        aria-label={isBare ? label : undefined}
        onChange={(event) => onChoose?.(event.currentTarget.value as T)}
      >
        {options.map(([option, text]) => (
          <option key={option} value={option}>
            {text}
          </option>
        ))}
      </select>
    </label>
  );
}
