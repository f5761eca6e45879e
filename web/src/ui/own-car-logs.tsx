/** Logs for a car: dropped, read by proposed mappings that can be corrected, audited, and learned. */

import type { Alike, LogsReading } from "../api/documents";
import { ENERGY } from "../model/units";
import { faultsOfCars } from "../state/own-cars";
import { isHeldBack, learn, logs, sendFiles, takeAnyway } from "../state/own-logs";
import { format, text, units } from "../state/preferences";
import { FaultList } from "./faults";
import { FileDrop } from "./file-drop";
import { OwnCarFiles } from "./own-car-files";
import { OwnCarKinds } from "./own-car-kinds";
import { rangeWithUnit } from "./wording";
import { Said } from "./said";
import { Button, Fold, put, Stat } from "./parts";

// eslint-disable-next-line page/text -- of the service: the trip is not used
const OUT = "set aside";

type Preview = NonNullable<LogsReading["preview"]>;
type Reason = Alike & { consequence?: Preview["findings"][number]["consequence"] };

/** What costs distance, or is noted. */
function Reasons({ of }: { of: Reason[] }) {
  const { ownCars: words } = text.value;
  return (
    <ul class="findings">
      {of.map(({ what, count, places, example, consequence }) => (
        <li key={`${consequence} ${example}`}>
          <strong>
            <Said of={what} />
          </strong>
          : {consequence ? words.inTrips(count, places) : words.inFiles(count, places)}
          {consequence && <span class="consequence"> {words.consequences[consequence]}</span>}
          <span class="note">
            {" "}
            <Said of={example.replace(`${what}: `, "")} />
          </span>
        </li>
      ))}
    </ul>
  );
}

function datesText(from: string, to: string | null): string {
  const day = new Intl.DateTimeFormat(format.value.locale, { dateStyle: "medium" });
  return day.formatRange(new Date(from), new Date(to ?? from));
}

/** What the logs hold for the car, and what of them is lost. */
function Learnable({ preview, report }: { preview: Preview | null; report: Alike[] }) {
  const { ownCars: words, conditions, result } = text.value;
  const { shown, duration, figure } = format.value;
  const { distance } = units.value;
  const reasons: Reason[] = [...(preview?.findings ?? []), ...report];
  const out = reasons.reduce((sum, { consequence, places }) => sum + (consequence === OUT ? places : 0), 0);
  const { lost_distance_m: lostM = 0, lost_duration_s: lostS = 0 } = preview ?? {};
  const lost = [
    out > 0 && words.tripsOut(out),
    (lostM > 0 || lostS > 0) && words.lost(shown(lostM, distance), duration(lostS)),
  ].filter(Boolean);
  return (
    <section aria-labelledby="own-car-learnable">
      <h4 id="own-car-learnable">{words.learnable}</h4>
      {preview ? (
        <dl class="learnable">
          <Stat label={words.trips}>{words.ofLogs(figure(preview.drives, 0), preview.logs)}</Stat>
          <Stat label={result.distance}>{shown(preview.distance_m, distance)}</Stat>
          <Stat label={result.time}>{duration(preview.duration_s)}</Stat>
          <Stat label={result.energy}>{shown(preview.energy_wh, ENERGY, 1)}</Stat>
          {preview.from_date && (
            <Stat label={words.dates}>{datesText(preview.from_date, preview.to_date)}</Stat>
          )}
          {preview.ambient_degc && (
            <Stat label={conditions.fields.ambient_temperature_degc}>
              {rangeWithUnit(preview.ambient_degc, units.value.temperature)}
            </Stat>
          )}
        </dl>
      ) : (
        <p>{words.nothingToLearn}</p>
      )}
      {reasons.length > 0 && (
        <Fold title={lost.join(" · ") || text.value.verdict.reasons(reasons.length)}>
          <Reasons of={reasons} />
        </Fold>
      )}
    </section>
  );
}

export function OwnCarLogs({ car }: { car: string }) {
  const { ownCars: words } = text.value;
  const now = logs.value?.car === car ? logs.value : null;
  const drives = now?.read?.preview?.drives ?? 0;
  return (
    <section aria-labelledby="own-car-logs">
      <h3 id="own-car-logs">{words.logs}</h3>
      {now && (
        <div class="actions start learn">
          {now.read && (
            <Button
              class="primary"
              disabled={drives === 0 || isHeldBack.value || now.stage !== "ready"}
              onClick={() => void learn()}
              label={words.learn(drives)}
            />
          )}
          {isHeldBack.value && <Button onClick={() => void takeAnyway()} label={words.takeAnyway} />}
          <Button onClick={put(logs, null)} label={text.value.cancel} />
        </div>
      )}
      <FileDrop
        label={words.dropLogs}
        formats={words.formats}
        accept=".csv,.tsv,.txt,.parquet,.xlsx,.zip"
        multiple
        onFiles={(files) => void sendFiles(car, files)}
      />
      <FaultList faults={faultsOfCars.value} />
      {now && (
        <div class="reading">
          <OwnCarFiles />
          {now.read && (
            <>
              <OwnCarKinds of={now.read} />
              <FaultList faults={now.read.faults} />
              <Learnable preview={now.read.preview} report={now.read.report} />
            </>
          )}
        </div>
      )}
    </section>
  );
}
