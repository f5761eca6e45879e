import type { Forecast } from "../api/documents";
import { HistoryChart } from "../charts/history";
import { interpolate } from "../model/interpolate";
import { PERCENT } from "../model/units";
import { arrived, distanceM, history, playing, RATES, rate, timeS, togglePlaying } from "../state/drive";
import { lengthM } from "../state/position";
import { format, text, units } from "../state/preferences";
import { Choice } from "./choice";
import { HistoryTable } from "./tables";
import { Button, into, Stat } from "./parts";

export function DriveControls() {
  const { drive } = text.value;
  const { duration, shown } = format.value;
  const { distance } = units.value;
  const [action, icon] = playing.value
    ? ([drive.pause, "pause"] as const)
    : arrived.value
      ? ([drive.again, "replay"] as const)
      : ([drive.start, "play"] as const);
  return (
    <div class="drive-controls">
      <Button class="primary" icon={icon} onClick={togglePlaying} label={action} />
      <Choice
        label={drive.rate}
        class="small"
        value={rate.value}
        options={RATES.map((value) => [value, `${value}×`] as const)}
        onChoose={into(rate)}
      />
      <p class="figures">
        {drive.progress(
          duration(timeS.value),
          shown(distanceM.value, distance),
          shown(lengthM.value, distance),
        )}
      </p>
    </div>
  );
}

export function DriveLine({ of }: { of: Forecast }) {
  const now = interpolate(distanceM.value, of.series.distance_m, of.series.displayed_soc);
  const naive = history.value.at(-1)?.naive ?? null;
  const { drive } = text.value;
  const { shown } = format.value;
  return (
    <dl class="stats drive-line">
      <Stat label={drive.now}>{shown(now, PERCENT)}</Stat>
      <Stat label={drive.forecast} class="is-main">
        {shown(of.soc_arrival, PERCENT, 1)}
      </Stat>
      <Stat label={drive.gauge} class="is-other">
        {naive === null ? "–" : shown(naive, PERCENT, 1)}
      </Stat>
    </dl>
  );
}

/** The errors of forecast and naive gauge at half the distance; empty before arrival. */
function errorsText(): string {
  const points = history.value;
  const end = points.at(-1);
  const half = points.find((m) => m.distanceM >= lengthM.value / 2 && m.naive !== null);
  if (!arrived.value || !end || !half || half.naive === null) return "";
  const off = (soc: number) => format.value.figure(Math.abs(PERCENT.from(soc - end.soc)), 1);
  return text.value.drive.errors(off(half.soc), off(half.naive));
}

export function DriveCard() {
  const { drive, result } = text.value;
  const errors = errorsText();
  return (
    <section class="card history" aria-labelledby="history-title">
      <h2 id="history-title">{drive.title}</h2>
      <p class="note">{drive.note}</p>
      <ul class="legend" aria-hidden="true">
        <li class="key-main">{result.forecast}</li>
        <li class="key-band">{result.band}</li>
        <li class="key-other">{drive.keyGauge}</li>
      </ul>
      {history.value.length > 1 ? (
        <HistoryChart height={240} label={`${drive.chart} ${errors}`} />
      ) : (
        <p class="empty">{drive.hint}</p>
      )}
      {errors && <p class="difference">{errors}</p>}
      <HistoryTable />
    </section>
  );
}
