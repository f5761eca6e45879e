/** Kinds of files: which column is what, for all files with the same columns at once. */

import { useState } from "preact/hooks";
import type { KindReading, LogsReading } from "../api/documents";
import { changeKind } from "../state/own-logs";
import { format, text } from "../state/preferences";
import { LOGGERS } from "../text/loggers";
import { DataTable } from "./data-table";
import { Select } from "./select";
import { Said } from "./said";
import { Button, Fold } from "./parts";

/** Columns that no forecast can be learned without. */
const NEEDED = ["time_s", "speed_m_s"];
/** Stands in the reason for a column that the service is not sure of. */
const DOUBT = "CHECK";
const MAX_UNUSED = 30;

/** Units as people write them. */
const UNIT_NAMES: Record<string, string> = {
  degc: "°C",
  degf: "°F",
  k: "K",
  v: "V",
  mv: "mV",
  kv: "kV",
  a: "A",
  ma: "mA",
  da: "0.1 A",
  w: "W",
  kw: "kW",
  // eslint-disable-next-line page/text -- a unit
  nm: "Nm",
  ps: "PS",
  "1": "0 … 1",
};

function fieldName(ours: string): string {
  const names: Record<string, string> = text.value.ownCars.fields;
  return names[ours] ?? ours;
}

/** The column and the unit of one of our columns; both can be corrected. */
function MappingRow({ of, kind, units }: { of: string; kind: KindReading; units: string[] }) {
  const { ownCars: words } = text.value;
  const now = kind.mapping.find(({ ours }) => ours === of);
  const name = fieldName(of);
  const change = (column: string, unit?: string) =>
    void changeKind(kind.number, { changes: { [of]: column ? { column, ...(unit && { unit }) } : null } });
  return (
    <tr>
      <th scope="row">{name}</th>
      <td>
        <Select
          isBare
          label={words.columnOf(name)}
          value={now?.column ?? ""}
          options={[["", words.noColumn], ...kind.columns.map((column) => [column, column] as const)]}
          onChoose={(column) => change(column)}
        />
      </td>
      <td>
        {now && (
          <Select
            isBare
            label={words.unitOf(name)}
            value={now.unit}
            options={units.map((unit) => [unit, UNIT_NAMES[unit] ?? unit])}
            onChoose={(unit) => change(now.column, unit)}
          />
        )}
      </td>
      <td class="why">{now && <Said of={now.why} />}</td>
    </tr>
  );
}

function Kind({ of, fields }: { of: KindReading; fields: LogsReading["fields"] }) {
  const { ownCars: words } = text.value;
  const mapped = of.mapping.map(({ ours }) => ours);
  const isDoubtful =
    of.mapping.some(({ why }) => why.includes(DOUBT)) || NEEDED.some((ours) => !mapped.includes(ours));
  const [open, setOpen] = useState(isDoubtful);
  const [all, setAll] = useState(false);
  const rows = fields.filter(({ ours }) => all || mapped.includes(ours) || NEEDED.includes(ours));
  const loggers: Record<string, string> = LOGGERS;
  const title = words.kind(of.files, of.shipped && (loggers[of.shipped] ?? of.shipped));
  return (
    <details class="as-table kind" open={open} onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary>
        {title}
        {isDoubtful && <span class="doubt"> {words.toCheck}</span>}
      </summary>
      <p class="note">{of.shipped ? words.knownLogger : words.proposed}</p>
      <DataTable label={title} class="mapping" heads={[words.what, words.column, words.unit, words.reason]}>
        {rows.map(({ ours, units }) => (
          <MappingRow key={ours} of={ours} kind={of} units={units} />
        ))}
      </DataTable>
      <Button
        class="link"
        aria-expanded={all}
        onClick={() => setAll(!all)}
        label={all ? words.fewerColumns : words.moreColumns}
      />
      <Select
        label={words.positive}
        value={of.current_positive}
        options={[
          ["discharge", words.discharge],
          ["charge", words.charge],
        ]}
        onChoose={(current_positive) => void changeKind(of.number, { current_positive })}
      />
      {of.assumed.usable_capacity_kwh !== undefined && (
        <p class="note">{words.bySoc(format.value.figure(of.assumed.usable_capacity_kwh, 1))}</p>
      )}
      {of.unused.length > 0 && (
        <Fold title={words.unused(of.unused.length)}>
          <p class="note">{format.value.list(of.unused.slice(0, MAX_UNUSED))}</p>
        </Fold>
      )}
    </details>
  );
}

export function OwnCarKinds({ of }: { of: LogsReading }) {
  return of.kinds.map((kind) => <Kind key={kind.number} of={kind} fields={of.fields} />);
}
