import { likelihoodOf, type Verdict } from "../model/arrival";
import { PERCENT } from "../model/units";
import { format, text } from "../state/preferences";
import { Icon } from "./icons";
import { chanceInFigures } from "./wording";

interface Props {
  verdict: Verdict;
  chance: number;
  /** The charge that the chance is for; 0 for arriving at all. */
  reserve: number;
  /** To arrive at all. */
  atAll: number;
  hasStops?: boolean;
}

/** The chance to arrive, in words and in figures. */
export function Chance({ verdict, chance, reserve, atAll, hasStops = false }: Props) {
  const { chance: words } = text.value;
  return (
    <p class={`chance chance-${verdict}`}>
      <Icon name={verdict === "good" ? "check" : "warning"} />
      <span>
        <strong>{words.words[likelihoodOf(chance)]}</strong>
        {reserve > 0 ? words.withReserve(format.value.shown(reserve, PERCENT), hasStops) : words.withCharge}
        <span class="figures"> · {chanceInFigures(chance)}</span>
        {reserve > 0 && <span class="at-all">{words.atAll(chanceInFigures(atAll))}</span>}
      </span>
    </p>
  );
}
