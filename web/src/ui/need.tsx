/** What a distance needs, and how far the charge goes. */

import type { RangeOfKind } from "../api/documents";
import { ENERGY, PERCENT } from "../model/units";
import { conditions } from "../state/conditions";
import { need, needIsOld, QUANTILE, range } from "../state/need";
import { format, text, units } from "../state/preferences";
import { problem } from "../state/forecast";
import { DataTable } from "./data-table";
import { Icon } from "./icons";
import { Warnings } from "./warnings";
import { Waiting } from "./failure";

/** Kilometres from the worst to the best of 9 of 10 trips. */
function intervalText([low = 0, high = 0]: readonly number[]): string {
  const { distance } = units.value;
  const { figure, shown } = format.value;
  return text.value.result.range(figure(distance.from(low), 0), shown(high, distance, 0));
}

function Kinds({ rows }: { rows: RangeOfKind[] }) {
  const { need: words } = text.value;
  const { shown } = format.value;
  const names: Record<string, string> = words.kinds;
  return (
    <DataTable label={words.byKind} heads={[words.kind, words.range, words.interval]}>
      {rows.map(({ kind, range_m, interval_m }) => (
        <tr key={kind}>
          <th scope="row">{names[kind] ?? kind}</th>
          <td>{shown(range_m, units.value.distance, 0)}</td>
          <td>{intervalText(interval_m)}</td>
        </tr>
      ))}
    </DataTable>
  );
}

export function NeedAnswer() {
  const needed = need.value;
  const far = range.value;
  if (!needed || !far) return problem.value ? null : <Waiting />;
  const { need: words, result, verdict } = text.value;
  const { duration, figure, shown } = format.value;
  const { soc, reserve } = conditions.value;
  const left = soc - needed.soc_needed;
  const suffices = left >= reserve;
  const [low = 0, high = 0] = needed.interval_wh.map(ENERGY.from);
  const flags = [...needed.flags, ...far.flags].filter(
    (flag, k, all) => all.findIndex(({ message }) => message === flag.message) === k,
  );
  return (
    <div class={`need${needIsOld.value ? " old" : ""}`} aria-busy={needIsOld.value}>
      <div class="headline">
        <p class="arrival">
          <span class="label">{words.needs(shown(needed.distance_m, units.value.distance, 0))}</span>
          <span class="number">
            {figure(ENERGY.from(needed.energy_quantile_wh), 1)}
            <small>{ENERGY.unit}</small>
          </span>
          <span class="range">
            {words.enoughFor(shown(QUANTILE, PERCENT))}
            <span class="missing">
              {words.half(shown(needed.energy_wh, ENERGY, 1))}
              {" · "}
              {result.inTrips(`${result.range(figure(low, 1), figure(high, 1))}\u00a0${ENERGY.unit}`)}
            </span>
          </span>
        </p>
        <dl class="whole">
          <div>
            <dt>{words.charge}</dt>
            <dd>{shown(needed.soc_needed, PERCENT)}</dd>
          </div>
          <div>
            <dt>{verdict.duration}</dt>
            <dd>{duration(needed.duration_s)}</dd>
          </div>
        </dl>
        <p class={`chance chance-${suffices ? "good" : left >= 0 ? "open" : "bad"}`}>
          <Icon name={suffices ? "check" : "warning"} />
          <span>
            {left < 0
              ? words.notEnough(shown(soc, PERCENT))
              : words.leaves(shown(soc, PERCENT), shown(left, PERCENT))}
          </span>
        </p>
      </div>
      <div class="far">
        <h3>{words.howFar(shown(soc, PERCENT), shown(reserve, PERCENT))}</h3>
        <p>
          <b class="number">{shown(far.range_m, units.value.distance, 0)}</b>{" "}
          <span class="range">{result.inTrips(intervalText(far.interval_m))}</span>
        </p>
        <Kinds rows={far.by_kind} />
      </div>
      <details class="sure">
        <summary>
          <b>{verdict.sure}</b> {words.basis}
        </summary>
        <Warnings flags={flags} others={[]} serious={null} />
      </details>
    </div>
  );
}
