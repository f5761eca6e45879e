import { warningsOf } from "../model/flags";
import { Icon } from "./icons";

/** What the forecast could not know. The serious ones stand before the picture, the others below it. */
export function Warnings({ flags, serious }: { flags: string[]; serious: boolean }) {
  const warnings = warningsOf(flags).filter((warning) => warning.serious === serious);
  if (warnings.length === 0) return null;
  return (
    <ul class="warnings" aria-label={serious ? "Warnings" : "Notes"}>
      {warnings.map(({ text, effect }) => (
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
