/** Logs of a car: dropped, read by a proposed mapping that can be corrected, audited, and learned. */

import { useState } from "preact/hooks";
import type { LogsReading } from "../api/documents";
import { ENERGY } from "../model/units";
import { changeReading, faultsOfCars, learn, reading, sendFiles, sending } from "../state/own-cars";
import { format, text, units } from "../state/preferences";
import { DataTable } from "./data-table";
import { FaultList } from "./faults";
import { FileDrop } from "./file-drop";
import { Select } from "./select";

const MAX_BYTES = 64_000_000;
/** Columns that no forecast can be learned without. */
const NEEDED = ["time_s", "speed_m_s"];
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
function MappingRow({ of, car, logs }: { of: string; car: string; logs: LogsReading }) {
  const { ownCars: words } = text.value;
  const now = logs.mapping.find(({ ours }) => ours === of);
  const units = logs.fields.find(({ ours }) => ours === of)?.units ?? [];
  const name = fieldName(of);
  const change = (column: string, unit?: string) =>
    void changeReading(car, { changes: { [of]: column ? { column, ...(unit && { unit }) } : null } });
  return (
    <tr>
      <th scope="row">{name}</th>
      <td>
        <select
          aria-label={words.columnOf(name)}
          value={now?.column ?? ""}
          onChange={(event) => change(event.currentTarget.value)}
        >
          <option value="">{words.noColumn}</option>
          {logs.columns.map((column) => (
            <option key={column} value={column}>
              {column}
            </option>
          ))}
        </select>
      </td>
      <td>
        {now && (
          <select
            aria-label={words.unitOf(name)}
            value={now.unit}
            onChange={(event) => change(now.column, event.currentTarget.value)}
          >
            {units.map((unit) => (
              <option key={unit} value={unit}>
                {UNIT_NAMES[unit] ?? unit}
              </option>
            ))}
          </select>
        )}
      </td>
      <td class="why" lang="en">
        {now?.why}
      </td>
    </tr>
  );
}

function Mapping({ car, logs }: { car: string; logs: LogsReading }) {
  const { ownCars: words } = text.value;
  const [all, setAll] = useState(false);
  const mapped = logs.mapping.map(({ ours }) => ours);
  const rows = logs.fields
    .map(({ ours }) => ours)
    .filter((ours) => all || mapped.includes(ours) || NEEDED.includes(ours));
  const unused = logs.unused.slice(0, MAX_UNUSED);
  return (
    <>
      <p class="note">{logs.shipped ? words.knownLogger(logs.shipped) : words.proposed}</p>
      <DataTable
        label={words.mapping}
        class="mapping"
        heads={[words.what, words.column, words.unit, words.reason]}
      >
        {rows.map((ours) => (
          <MappingRow key={ours} of={ours} car={car} logs={logs} />
        ))}
      </DataTable>
      <button type="button" class="link" aria-expanded={all} onClick={() => setAll(!all)}>
        {all ? words.fewerColumns : words.moreColumns}
      </button>
      <Select
        label={words.positive}
        value={logs.current_positive}
        options={[
          ["discharge", words.discharge],
          ["charge", words.charge],
        ]}
        onChoose={(current_positive) => void changeReading(car, { current_positive })}
      />
      {logs.assumed.usable_capacity_kwh !== undefined && (
        <p class="note">{words.bySoc(format.value.figure(logs.assumed.usable_capacity_kwh, 1))}</p>
      )}
      {unused.length > 0 && (
        <details class="as-table">
          <summary>{words.unused(logs.unused.length)}</summary>
          <p class="note">{format.value.list(unused)}</p>
        </details>
      )}
    </>
  );
}

/** What the audit found, in the words of the service. */
function Audit({ preview }: { preview: NonNullable<LogsReading["preview"]> }) {
  const { ownCars: words } = text.value;
  const { shown } = format.value;
  const { logs, drives, distance_m, energy_wh, findings, n_findings } = preview;
  return (
    <>
      <p>
        <strong>
          {words.audit(logs, drives, shown(distance_m, units.value.distance), shown(energy_wh, ENERGY))}
        </strong>
      </p>
      {n_findings > 0 && (
        <details class="as-table" open={drives === 0}>
          <summary>{words.findings(n_findings)}</summary>
          <ul class="findings" lang="en">
            {findings.map(({ trip, from_s, what, consequence }) => (
              <li key={`${trip} ${from_s} ${what}`}>
                {trip}: {what} ({consequence})
              </li>
            ))}
          </ul>
        </details>
      )}
    </>
  );
}

export function OwnCarLogs({ car }: { car: string }) {
  const { ownCars: words } = text.value;
  const now = reading.value;
  const drives = now?.logs.preview?.drives ?? 0;
  return (
    <section aria-labelledby="own-car-logs">
      <h3 id="own-car-logs">{words.logs}</h3>
      <FileDrop
        label={words.dropLogs}
        formats={words.formats}
        accept=".csv,.tsv,.txt,.parquet,.xlsx,.zip"
        multiple
        mostBytes={MAX_BYTES}
        onFiles={(files) => void sendFiles(car, files)}
      />
      <p class="note" role="status">
        {sending.value && words.sending(sending.value)}
      </p>
      <FaultList faults={faultsOfCars.value} />
      {now && (
        <div class="reading">
          <Mapping car={car} logs={now.logs} />
          {now.logs.preview && <Audit preview={now.logs.preview} />}
          <FaultList faults={now.logs.faults} />
          <div class="actions">
            <button
              type="button"
              disabled={sending.value !== null}
              onClick={() => {
                reading.value = null;
              }}
            >
              {words.cancel}
            </button>
            <button
              type="button"
              class="primary"
              disabled={drives === 0 || sending.value !== null}
              onClick={() => void learn(car)}
            >
              {words.learn(drives)}
            </button>
          </div>
        </div>
      )}
    </section>
  );
}
