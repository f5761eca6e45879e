import type { Forecast } from "../api/documents";
import { waterfall } from "../model/causes";
import { ENERGY } from "../model/units";
import { isMeasured, model } from "../state/car";
import { format, text } from "../state/preferences";
import { Climb } from "./climb";

/** Digits of a kilowatt-hour. */
const DIGITS = 2;

type Caused = Pick<Forecast, "by_cause_wh" | "energy_wh">;

interface Parts {
  of: Caused;
  caption: string;
  total: string;
  /** Whether the parts are changes: they have signs, and what is saved has the colour. */
  isChange?: boolean;
  other?: Caused | null;
}

/** Energy by cause: a table with a waterfall chart in its cells. */
export function Waterfall({ of, caption, total, isChange = false, other = null }: Parts) {
  const { figure, signed } = format.value;
  const { causes, compare } = text.value;
  const names: Record<string, string> = isChange ? { ...causes.names, ...causes.changes } : causes.names;
  const shown = isChange ? signed : figure;
  const steps = waterfall(of.by_cause_wh, new Set(isChange ? [] : ["correction", "climate"]));
  const ends = steps.flatMap((step) => [step.startWh, step.startWh + step.energyWh]);
  const low = Math.min(0, ...ends);
  const high = Math.max(of.energy_wh, 0, ...ends);
  const percentOf = (wh: number) => `${(((wh - low) / (high - low)) * 100).toFixed(2)}%`;
  const bar = (from: number, to: number) => ({
    left: percentOf(Math.min(from, to)),
    width: `${((Math.abs(to - from) / (high - low)) * 100).toFixed(2)}%`,
  });
  return (
    <table class={isChange ? "changes" : ""}>
      <caption class="unseen">{caption}</caption>
      <thead class={other ? "" : "unseen"}>
        <tr>
          <th scope="col">
            <span class="unseen">{causes.cause}</span>
          </th>
          <td aria-hidden="true" />
          <th scope="col" class="value">
            {other ? compare.first : causes.energyIn(ENERGY.unit)}
          </th>
          {other && (
            <th scope="col" class="value">
              {compare.change}
            </th>
          )}
        </tr>
      </thead>
      <tbody>
        {steps.map(({ key, group, energyWh, startWh }) => (
          <tr key={key} class={`group-${group}`}>
            <th scope="row">{names[key] ?? key}</th>
            <td class="picture" aria-hidden="true">
              <span class={energyWh < 0 ? "back" : ""} style={bar(startWh, startWh + energyWh)} />
            </td>
            <td class="value">{shown(ENERGY.from(energyWh), DIGITS)}</td>
            {other && (
              <td class="value change">
                {signed(ENERGY.from((other.by_cause_wh[key] ?? 0) - energyWh), DIGITS)}
              </td>
            )}
          </tr>
        ))}
      </tbody>
      <tfoot>
        <tr>
          <th scope="row">{total}</th>
          <td class="picture" aria-hidden="true">
            <span style={bar(0, of.energy_wh)} />
          </td>
          <td class="value">{shown(ENERGY.from(of.energy_wh), DIGITS)}</td>
          {other && (
            <td class="value change">{signed(ENERGY.from(other.energy_wh - of.energy_wh), DIGITS)}</td>
          )}
        </tr>
      </tfoot>
    </table>
  );
}

interface Props {
  of: Caused & Pick<Forecast, "battery_loss_wh">;
  road: Forecast;
  other: Caused | null;
}

/** The card of the energy by cause. */
export function Causes({ of, road, other }: Props) {
  const { causes } = text.value;
  return (
    <section class="card causes" aria-labelledby="causes-title">
      <h2 id="causes-title">{causes.title}</h2>
      <Waterfall of={of} caption={causes.caption} total={causes.total} other={other} />
      <p class="note">
        {causes.note(ENERGY.unit, format.value.shown(of.battery_loss_wh, ENERGY))} <Climb of={road} />{" "}
        {isMeasured.value ? causes.learnedOwn : causes.learnedOf(model.value?.model.car_title ?? "")}
      </p>
    </section>
  );
}
