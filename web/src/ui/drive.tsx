import type { Answer } from "../api/types";
import { PromiseChart } from "../charts/promise";
import { interpolate } from "../model/interpolate";
import { duration, figure, PERCENT, shown } from "../model/units";
import { arrived, distanceM, history, playing, RATES, rate, timeS, togglePlaying } from "../state/drive";
import { lengthM } from "../state/pointer";
import { units } from "../state/preferences";
import { Choice } from "./choice";
import { Icon } from "./icons";
import { PromiseTable } from "./tables";

export function DriveControls() {
  const action = playing.value ? "Pause" : arrived.value ? "Start again" : "Start";
  const icon = playing.value ? "pause" : arrived.value ? "replay" : "play";
  return (
    <div class="drive-controls">
      <button type="button" class="primary" onClick={togglePlaying}>
        <Icon name={icon} />
        {action}
      </button>
      <Choice
        label="How fast the time goes"
        class="small"
        value={String(rate.value)}
        options={RATES.map((value) => [String(value), `${value}×`] as const)}
        onChoose={(value) => {
          rate.value = Number(value) as typeof rate.value;
        }}
      />
      <p class="figures">
        {duration(timeS.value)} on the way · {shown(distanceM.value, units.value.distance)} of{" "}
        {shown(lengthM.value, units.value.distance)}
      </p>
    </div>
  );
}

export function DriveLine({ of }: { of: Answer }) {
  const last = history.value.at(-1);
  const now = interpolate(distanceM.value, of.series.distance_m, of.series.displayed_soc);
  const naive = last?.naive ?? null;
  return (
    <dl class="stats drive-line">
      <div>
        <dt>Battery now</dt>
        <dd>{shown(now, PERCENT)}</dd>
      </div>
      <div>
        <dt>Forecast of arrival</dt>
        <dd class="is-main">{shown(of.soc_arrival, PERCENT, 1)}</dd>
      </div>
      <div>
        <dt>Naive gauge</dt>
        <dd class="is-other">{naive === null ? "–" : shown(naive, PERCENT, 1)}</dd>
      </div>
    </dl>
  );
}

/** How far both were off at the end, once that is known. */
function verdict(): string {
  const said = history.value;
  const end = said.at(-1);
  if (!arrived.value || !end) return "";
  const half = said.find((m) => m.distanceM >= lengthM.value / 2 && m.naive !== null);
  if (!half || half.naive === null) return "";
  const off = (soc: number) => figure(Math.abs(PERCENT.from(soc - end.soc)), 1);
  return `Half way, the forecast was ${off(half.soc)} points off, the naive gauge ${off(half.naive)}.`;
}

export function DriveCard() {
  return (
    <section class="card promise" aria-labelledby="promise-title">
      <h2 id="promise-title">What was promised on the way</h2>
      <p class="note">
        Battery on arrival as said at each place: by the forecast, which knows the road ahead, and by a naive
        gauge, which takes the consumption so far for the rest.
      </p>
      <ul class="legend" aria-hidden="true">
        <li class="key-main">forecast</li>
        <li class="key-band">9 of 10</li>
        <li class="key-other">naive gauge</li>
      </ul>
      {history.value.length > 1 ? (
        <PromiseChart height={240} label={`Battery on arrival as promised along the way. ${verdict()}`} />
      ) : (
        <p class="empty">Press Start: the car moves, and the forecast with it.</p>
      )}
      {verdict() && <p class="difference">{verdict()}</p>}
      <PromiseTable />
    </section>
  );
}
