/** What a distance needs, and how far the charge goes. */

import type { Doubt, RangeOfKind } from "../api/documents";
import type { Verdict } from "../model/arrival";
import { sufficing } from "../model/distance";
import { ENERGY, PERCENT } from "../model/units";
import { conditions } from "../state/conditions";
import { need, needIsOld, range } from "../state/need";
import { format, text, units } from "../state/preferences";
import { problem } from "../state/forecast";
import { DataTable } from "./data-table";
import { Icon } from "./icons";
import { Warnings } from "./warnings";
import { Waiting } from "./failure";
import { Stat } from "./parts";
import { rangeWithUnit } from "./wording";

function Kinds({ rows }: { rows: RangeOfKind[] }) {
  const { need: words } = text.value;
  const { shown } = format.value;
  const names: Record<string, string> = text.value.distanceForm.kinds;
  return (
    <DataTable
      label={words.byKind}
      heads={[text.value.distanceForm.kind, words.range, words.interval, words.cautious]}
    >
      {rows.map(({ kind, range_m, half_m, interval_m }) => (
        <tr key={kind}>
          <th scope="row">{names[kind] ?? kind}</th>
          <td>{shown(range_m, units.value.distance, 0)}</td>
          <td>{rangeWithUnit(half_m, units.value.distance, 0)}</td>
          <td>{shown(interval_m[0], units.value.distance, 0)}</td>
        </tr>
      ))}
    </DataTable>
  );
}

/** What the uncertainty comes from, and which input would narrow it most. */
function doubtText({ car, road, weather, day, narrows, narrower }: Doubt): string {
  const { need: words } = text.value;
  const shares = [car, road, weather, day].map((share) => format.value.shown(share, PERCENT));
  const inputs: Record<string, string> = words.inputs;
  const most = narrows && words.narrows(inputs[narrows] ?? narrows, format.value.shown(narrower, PERCENT));
  const [ofCar = "", ofRoad = "", ofWeather = "", ofDay = ""] = shares;
  return [words.doubt(ofCar, ofRoad, ofWeather, ofDay), most].filter(Boolean).join(" ");
}

function answer() {
  return need.value && sufficing(conditions.value.soc, need.value);
}

export function needVerdict(): Verdict | null {
  return answer()?.verdict ?? null;
}

/** Whether the charge suffices, in a sentence. */
export function needSentence(): string {
  const { need: words } = text.value;
  const found = answer();
  if (!need.value || !found) return words.title;
  const { shown } = format.value;
  const soc = shown(conditions.value.soc, PERCENT);
  const far = shown(need.value.distance_m, units.value.distance, 0);
  const said = { good: words.suffices, open: words.probably, bad: words.notEnough };
  return said[found.verdict](soc, far);
}

export function NeedAnswer() {
  const needed = need.value;
  const far = range.value;
  const found = answer();
  if (!needed || !far || !found) return problem.value ? null : <Waiting />;
  const { need: words, result, verdict: others } = text.value;
  const { duration, figure, shown } = format.value;
  const { soc, reserve } = conditions.value;
  const { arrival, lacking, left, verdict } = found;
  const isMore = needed.soc_needed > 1;
  const flags = [...needed.flags, ...far.flags].filter(
    (flag, k, all) => all.findIndex(({ message }) => message === flag.message) === k,
  );
  return (
    <div class="need" aria-busy={needIsOld.value}>
      <div class="headline">
        <p class="arrival">
          <span class="label">{words.needs(shown(needed.distance_m, units.value.distance, 0))}</span>
          <span class="number">
            {figure(ENERGY.from(needed.energy_wh), 1)}
            <small>{`\u00a0${ENERGY.unit}`}</small>
          </span>
          <span class="range">
            {words.half(rangeWithUnit(needed.half_wh, ENERGY, 1))}
            <span class="missing">{words.enoughFor(shown(needed.energy_quantile_wh, ENERGY, 1))}</span>
          </span>
        </p>
        <dl class="whole">
          <Stat label={result.onArrival}>{words.about(shown(arrival, PERCENT))}</Stat>
          <Stat label={words.charge}>{isMore ? words.moreThanFull : shown(needed.soc_needed, PERCENT)}</Stat>
          <Stat label={others.duration}>{duration(needed.duration_s)}</Stat>
        </dl>
        <p class={`chance chance-${verdict}`}>
          <Icon name={verdict === "good" ? "check" : "warning"} />
          <span>
            {lacking <= 0
              ? words.leaves(shown(left, PERCENT))
              : isMore
                ? words.full
                : words.lacking(shown(needed.soc_needed, PERCENT))}
          </span>
        </p>
      </div>
      <div class="far">
        <h3>{words.howFar(shown(soc, PERCENT), shown(reserve, PERCENT))}</h3>
        <p>
          <b class="number">{shown(far.range_m, units.value.distance, 0)}</b>{" "}
          <span class="figures">{words.atLeast(shown(far.interval_m[0], units.value.distance, 0))}</span>
        </p>
        <Kinds rows={far.by_kind} />
      </div>
      <details class="sure">
        <summary>
          <b>{others.sure}</b> {words.basis}
        </summary>
        <p class="note">{doubtText(needed.doubt)}</p>
        <Warnings flags={flags} serious={null} />
      </details>
    </div>
  );
}
