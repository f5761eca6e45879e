import { warningsOf } from "../model/flags";
import { Icon } from "./icons";

interface Props {
  flags: string[];
  /** Flags of the second side of a comparison. */
  others: string[];
  serious: boolean;
}

/** What the forecast could not know. The serious ones stand before the picture, the others below it. */
export function Warnings({ flags, others, serious }: Props) {
  const own = warningsOf(flags);
  const further = warningsOf(others.filter((flag) => !flags.includes(flag)));
  const warnings = [...own, ...further.map((one) => ({ ...one, text: `On the second side: ${one.text}` }))];
  const shown = warnings.filter((warning) => warning.serious === serious);
  if (shown.length === 0) return null;
  return (
    <ul class="warnings" aria-label={serious ? "Warnings" : "Notes"}>
      {shown.map(({ text, effect }) => (
        <li key={text} class={serious ? "serious" : ""}>
          <Icon name={serious ? "warning" : "info"} />
          <span>
            {text} {effect}
          </span>
        </li>
      ))}
    </ul>
  );
}
