import { warningOf } from "../model/flags";
import { Icon } from "./icons";

export function Warnings({ flags }: { flags: string[] }) {
  if (flags.length === 0) return null;
  return (
    <ul class="warnings" aria-label="Warnings">
      {flags.map((flag) => {
        const { text, effect, serious } = warningOf(flag);
        return (
          <li key={flag} class={serious ? "serious" : ""}>
            <Icon name={serious ? "warning" : "info"} />
            <span>
              {text} {effect}
            </span>
          </li>
        );
      })}
    </ul>
  );
}
