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
  atAll: number;
  of?: "end" | "stops" | "fromFirst";
}

/** The chance to arrive, in words and in figures; first of the reserve, but where the car arrives and does not keep it. */
export function Chance({ verdict, chance, reserve, atAll, of = "end" }: Props) {
  const { chance: words } = text.value;
  const kept = reserve > 0 ? words.withReserve[of](format.value.shown(reserve, PERCENT)) : words.withCharge;
  const isRisky = verdict === "bad" && atAll >= 0.5; // "likely" says too much of a car that may strand
  const isBelow = reserve > 0 && chance < 0.5 && atAll >= 0.5;
  return (
    <p class={`chance chance-${verdict}`}>
      <Icon name={verdict === "good" ? "check" : "warning"} />
      <span>
        <strong>{isRisky ? words.risky : words.words[likelihoodOf(isBelow ? atAll : chance)]}</strong>
        {isBelow ? words.withCharge : kept}
        <span class="figures"> · {chanceInFigures(isBelow ? atAll : chance)}</span>
        {reserve > 0 && (of !== "fromFirst" || chanceInFigures(chance) !== chanceInFigures(atAll)) && (
          <span class="at-all">
            {isBelow
              ? words.keeps(format.value.shown(reserve, PERCENT), chanceInFigures(chance))
              : words.atAll(chanceInFigures(atAll))}
          </span>
        )}
      </span>
    </p>
  );
}
