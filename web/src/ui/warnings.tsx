import type { Flag } from "../api/documents";
import { warningsOf } from "../model/flags";
import { text, wording } from "../state/preferences";
import { Icon } from "./icons";
import { Said } from "./said";

interface Props {
  flags: Flag[];
  /** Flags of the second forecast of a comparison. */
  others?: Flag[];
  /** Null for both. */
  serious: boolean | null;
}

/** Warnings (`serious`) or notes of a forecast, or both. */
export function Warnings({ flags, others = [], serious }: Props) {
  const { flags: words, compare } = text.value;
  const own = warningsOf(flags, wording.value);
  const further = warningsOf(others, wording.value)
    .filter((one) => !own.some((known) => known.text === one.text))
    .map((one) => ({ ...one, text: compare.onSecond(one.text) }));
  const warnings = [...own, ...further];
  const shown = warnings.filter((warning) => serious === null || warning.serious === serious);
  if (shown.length === 0) return null;
  return (
    <ul class="warnings" aria-label={serious ? words.warnings : words.notes}>
      {shown.map(({ text: warning, effect, isRaw }) => (
        <li key={warning} class={serious ? "serious" : ""}>
          <Icon name={serious ? "warning" : "info"} />
          <span>{isRaw ? <Said of={warning} /> : `${warning} ${effect}`}</span>
        </li>
      ))}
    </ul>
  );
}
