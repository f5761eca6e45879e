/** What to do about the trip: the least that makes it arrive, then what each action saves. */

import type { Advised, AdvisedAction, Whole } from "../api/documents";
import { verdictOf } from "../model/arrival";
import { ENERGY, PERCENT } from "../model/units";
import { advice, adviceIsOld } from "../state/advice";
import { stopInDoubt } from "../state/answer";
import { isSlow } from "../state/charging";
import { source } from "../state/catalogue";
import { conditions } from "../state/conditions";
import { chosenCharging, chosenRoad, journey } from "../state/journey";
import { format, text, units } from "../state/preferences";
import { Waterfall } from "./causes";
import { labelOf } from "./journey-answer";
import { chanceInFigures, clockText, range } from "./wording";

/** Shorter delays are not named. */
const MIN_SHOWN_S = 30;
/** Times in all that differ by less are about the same: plans are found to within this share. */
const SAME = 0.01;

/** When something on the plug begins: its time where that of the departure is chosen. */
function startText(before_s: number): string {
  const { actions } = text.value.advice;
  const { departsAt } = conditions.value;
  if (departsAt === null) return actions.before(format.value.span(before_s));
  const leaves = new Date(departsAt);
  return actions.start(clockText(new Date(leaves.getTime() - before_s * 1000), leaves));
}

function actionText({ code, value, before_s }: AdvisedAction): string {
  const { shown, span } = format.value;
  const { speed, temperature, mass } = units.value;
  const { actions } = text.value.advice;
  const si = value ?? 0;
  switch (code) {
    case "slower":
      return actions.slower(shown(si, speed));
    case "setpoint":
      return actions.setpoint(shown(si, temperature));
    case "preheat_cabin":
      return actions[code](shown(si, temperature), startText(before_s));
    case "other_road":
      return actions.other_road(journey.value ? labelOf(journey.value, si) : String(si + 1));
    case "leave_later":
      return si < 0 ? actions.leave_earlier(span(-si)) : actions.leave_later(span(si));
    case "pump_up":
      return actions.pump_up(shown(si, PERCENT));
    case "less_luggage":
      return actions.less_luggage(shown(si, mass));
    default:
      return actions[code];
  }
}

export function togetherText({ actions }: Advised): string {
  const [first = "", ...more] = actions.map(actionText);
  return [first, ...more.map((words) => words.charAt(0).toLowerCase() + words.slice(1))].join(
    text.value.advice.and,
  );
}

function longer({ difference: { duration_s } }: Advised): string {
  const { span } = format.value;
  return duration_s >= MIN_SHOWN_S ? text.value.journey.longer(span(duration_s)) : text.value.advice.noTime;
}

/** The journey with its charging stops, beside that without the action; with its chance where that is in doubt. */
function wholeText({ duration_s, charges, p_reserve }: Whole, now: Whole): string {
  const { advice: words } = text.value;
  const { duration } = format.value;
  const [then, before] = [duration_s, now.duration_s].map((s) => 60 * Math.round(s / 60)) as [number, number];
  const more = then - before; // of the times as they are shown
  const isSame = Math.abs(more) < Math.max(SAME * now.duration_s, MIN_SHOWN_S);
  const change = isSame
    ? words.asLong
    : text.value.journey[more < 0 ? "less" : "more"](duration(Math.abs(more)));
  const whole = words.whole(duration(duration_s), charges, change);
  if (verdictOf(p_reserve) === "good") return whole;
  return `${whole} · ${text.value.journey.reached(chanceInFigures(p_reserve))}`;
}

function Saving({ of, now }: { of: Advised; now: Whole | null }) {
  const { advice: words, result } = text.value;
  const { shown } = format.value;
  const { difference, p_arrive, wall_wh } = of;
  const saved = difference.interval_wh.map((wh) => -wh).reverse();
  const arrives = words.arrives(shown(Math.max(of.soc_arrival, 0), PERCENT), chanceInFigures(p_arrive));
  const parts = [
    ...(now ? [of.whole && wholeText(of.whole, now)] : [arrives, longer(of)]),
    wall_wh > 0 && words.wall(shown(wall_wh, ENERGY)),
  ];
  return (
    <li>
      <h3>{togetherText(of)}</h3>
      <p class="figures">
        <b>{words[of.saves](shown(-difference.energy_wh, ENERGY))}</b>{" "}
        <small>{result.inTrips(range(saved, ENERGY))}</small>
      </p>
      <p class="figures">{parts.filter(Boolean).join(" · ")}</p>
      <details class="causes">
        <summary>{words.why}</summary>
        <Waterfall of={difference} caption={words.whyCaption} total={words.inAll} isChange />
        <p class="note">{words.whyNote(ENERGY.unit)}</p>
      </details>
    </li>
  );
}

export function AdviceCard() {
  const found = advice.value;
  if (!found || source.value === "distance" || found.singly.length === 0) return null;
  if (stopInDoubt.value || isSlow.value) return null; // what helps to get there stands above
  const { advice: words } = text.value;
  const wanted = format.value.shown(found.probability, PERCENT);
  const arrivesWithStops = found.whole !== null && found.whole.p_reserve >= found.probability;
  const least = arrivesWithStops ? words.leastWithoutStops : words.least;
  return (
    <section class="card advice" aria-labelledby="advice-title" aria-busy={adviceIsOld.value}>
      <h2 id="advice-title">{words.title}</h2>
      {found.p_arrive < found.probability && !(arrivesWithStops && found.least.length === 0) && (
        <>
          <p>{found.least.length > 0 ? least(wanted) : words.notEnough(wanted)}</p>
          <ul class="least">
            {found.least.map((one) => (
              <li key={togetherText(one)}>
                <b>{togetherText(one)}</b>: {chanceInFigures(one.p_arrive)}, {longer(one)}
              </li>
            ))}
          </ul>
        </>
      )}
      <p class="note">
        {found.singly.length > 0 && words.note}{" "}
        {chosenRoad.value + chosenCharging.value > 0 && words.compared}
      </p>
      <ul class="savings">
        {found.singly.map((one) => (
          <Saving key={togetherText(one)} of={one} now={found.whole} />
        ))}
      </ul>
    </section>
  );
}
