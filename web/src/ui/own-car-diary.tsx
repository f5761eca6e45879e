/** What a car has learned, before and after, and its diary: each trip as it was forecast, and what it took. */

import type { DiaryEntry, OwnCar } from "../api/documents";
import { isBetter, reasonsOf, seenIn, type Trend, trendOf } from "../model/diary";
import { ENERGY, PERCENT } from "../model/units";
import { format, text, units } from "../state/preferences";
import { DataTable } from "./data-table";
import { FaultList } from "./faults";
import { range, rangeWithUnit } from "./wording";
import { said } from "../state/messages";
import { Fold } from "./parts";

/** Factors below this share of their standard deviation are not shown by the trips. */
const MIN_SHOWN = 0.5;

function percent(share: number | null, digits = 1): string {
  return share === null ? "–" : `${format.value.figure(PERCENT.from(share), digits)}\u00a0%`;
}

/** A factor of the car, and the outside temperatures at which its trips show it. */
function Factor({
  name,
  of: { change, sd, unit, seen_degc },
}: {
  name: string;
  of: OwnCar["learned"][string];
}) {
  const { ownCars: words } = text.value;
  const { signed, figure } = format.value;
  const isPower = unit === "kW";
  const [value, digits, sign] = isPower ? [change, 2, "kW"] : [PERCENT.from(change), 0, "%"];
  return (
    <tr class={seen_degc ? "" : "not-seen"}>
      <th scope="row">{words.parameters[name as keyof typeof words.parameters]}</th>
      <td>
        {`${signed(value, digits)}\u00a0${sign}`}{" "}
        <span class="note">{`± ${figure(isPower ? sd : PERCENT.from(sd), digits)} ${sign}`}</span>
      </td>
      <td>{seen_degc ? rangeWithUnit(seen_degc, units.value.temperature) : words.notSeen}</td>
    </tr>
  );
}

function Learned({ of }: { of: OwnCar }) {
  const { ownCars: words } = text.value;
  const factors = Object.entries(of.learned);
  const isShown = ({ change, sd, seen_degc }: OwnCar["learned"][string]) =>
    seen_degc !== null && Math.abs(change) >= MIN_SHOWN * sd;
  const shown = factors.filter(([, factor]) => isShown(factor));
  const others = factors.filter(([, factor]) => !isShown(factor));
  const seen = seenIn(of.learned);
  const table = (label: string, rows: typeof factors) => (
    <DataTable label={label} class="learned" heads={[words.factor, words.differs, words.seenAt]}>
      {rows.map(([name, factor]) => (
        <Factor key={name} name={name} of={factor} />
      ))}
    </DataTable>
  );
  return (
    <>
      {seen && <p>{words.seen(rangeWithUnit(seen, units.value.temperature))}</p>}
      {shown.length > 0 && table(words.taught, shown)}
      {others.length > 0 && (
        <Fold title={words.otherFactors(others.length)}>
          {table(words.otherFactors(others.length), others)}
        </Fold>
      )}
    </>
  );
}

/** Forecast, its interval, the part of it that was needed over all trips, and what the trip took, on one scale. */
function Spread({ of, most, needed }: { of: DiaryEntry; most: number; needed: number | null }) {
  const middle = (of.low_wh + of.high_wh) / 2;
  const half = ((needed ?? 0) * (of.high_wh - of.low_wh)) / 2;
  const at = (wh: number) => `${Math.min(100, Math.max(0, (100 * wh) / most))}%`;
  const isInside = of.low_wh <= of.energy_wh && of.energy_wh <= of.high_wh;
  return (
    <div class="spread" aria-hidden="true">
      <i class="band" style={{ left: at(of.low_wh), width: `calc(${at(of.high_wh)} - ${at(of.low_wh)})` }} />
      {needed !== null && (
        <i
          class="needed"
          style={{ left: at(middle - half), width: `calc(${at(middle + half)} - ${at(middle - half)})` }}
        />
      )}
      <i class="middle" style={{ left: at(of.forecast_wh) }} />
      <i class={isInside ? "took" : "took outside"} style={{ left: at(of.energy_wh) }} />
    </div>
  );
}

/** The forecasts that were shown on the way: at departure, half-way, and the last one. */
function shownOnTheWay(of: DiaryEntry): string {
  const { ownCars: words } = text.value;
  const kwh = (wh: number) => format.value.figure(ENERGY.from(wh), 2);
  const made = of.on_the_way;
  const first = made[0]?.at_s === 0 ? made[0] : undefined;
  const half = made.find((row) => row !== first && row.distance_m >= of.distance_m / 2);
  const last = made.at(-1);
  return [
    first && words.atDeparture(kwh(first.energy_wh)),
    half && words.halfWay(kwh(half.energy_wh)),
    last && last !== half && last !== first && words.atLast(kwh(last.energy_wh)),
  ]
    .filter(Boolean)
    .join(" · ");
}

function Trips({ of }: { of: OwnCar }) {
  const { ownCars: words, result, trip } = text.value;
  const { figure, shown, signed } = format.value;
  const most = Math.max(1, ...of.diary.map((row) => Math.max(row.high_wh, row.energy_wh)));
  const { width, needed_width } = of.score;
  const needed = width && needed_width !== null ? needed_width / width : null;
  const day = new Intl.DateTimeFormat(format.value.locale, { dateStyle: "medium", timeStyle: "short" });
  const kwh = (wh: number) => figure(ENERGY.from(wh), 2);
  const heads = [trip.title, result.distance, words.forecast, words.picture, words.took, words.error];
  return (
    <DataTable label={words.diary} class="diary with-picture" heads={heads}>
      {of.diary.map((row) => (
        <tr key={row.trip}>
          <th scope="row">
            {row.started_at ? day.format(new Date(row.started_at)) : row.trip}
            {row.ambient_temperature_degc !== null && (
              <span class="note"> {shown(row.ambient_temperature_degc, units.value.temperature)}</span>
            )}
          </th>
          <td>{shown(row.distance_m, units.value.distance)}</td>
          <td>
            {kwh(row.forecast_wh)} ({range([row.low_wh, row.high_wh], ENERGY, 2)})
            {row.on_the_way.length > 0 && <span class="note way"> {shownOnTheWay(row)}</span>}
          </td>
          <td>
            <Spread of={row} most={most} needed={needed} />
          </td>
          <td>
            {kwh(row.energy_wh)}
            {(row.energy_wh < row.low_wh || row.energy_wh > row.high_wh) && (
              <span class="note"> {words.isOutside}</span>
            )}
          </td>
          <td>{signed(ENERGY.from(row.forecast_wh - row.energy_wh), 2)}</td>
        </tr>
      ))}
    </DataTable>
  );
}

function Seasons({ of }: { of: OwnCar }) {
  const { ownCars: words, result } = text.value;
  const { figure, shown } = format.value;
  const { consumption, distance } = units.value;
  const seasons = Object.entries(of.by_season);
  if (seasons.length === 0) return null;
  const heads = [words.season, words.trips, result.distance, consumption.unit, words.error, words.coverage];
  return (
    <DataTable label={words.seasons} class="diary" caption={words.seasons} heads={heads}>
      {seasons.map(([name, row]) => (
        <tr key={name}>
          <th scope="row">{words.quarters[name as keyof typeof words.quarters]}</th>
          <td>{figure(row.trips, 0)}</td>
          <td>{shown(row.distance_m, distance, 0)}</td>
          <td>
            {row.distance_m > 0 && row.energy_wh > 0
              ? figure(consumption.from(row.energy_wh / row.distance_m), 1)
              : "–"}
          </td>
          <td>{percent(row.error)}</td>
          <td>{percent(row.coverage, 0)}</td>
        </tr>
      ))}
    </DataTable>
  );
}

/** Errors as a line, from none at the bottom. */
function Line({ of: { course } }: { of: Trend }) {
  const most = Math.max(...course) || 1;
  const points = course.map((error, k) => `${(100 * k) / (course.length - 1)},${30 - (28 * error) / most}`);
  return (
    <svg class="error-line" viewBox="0 0 100 32" preserveAspectRatio="none" aria-hidden="true">
      <polyline points={points.join(" ")} />
    </svg>
  );
}

/** What the own trips gain: the error of the last ones with them and without them, and of those before. */
function Gain({ of }: { of: OwnCar }) {
  const { latest, latest_by_book: book, diary } = of;
  const { ownCars: words } = text.value;
  const gain = isBetter(of) ? "" : words.noGain;
  const trend = trendOf(diary);
  const { trips, before, latest: now } = trend;
  if (latest.weighted_error === null) return null;
  return (
    <div class="error-now">
      <p class="arrival">
        <span class="label">{words.errorOfLast(latest.trips)}</span>
        <span class="number">
          {format.value.figure(PERCENT.from(latest.weighted_error), 1)}
          <small>{PERCENT.unit}</small>
        </span>
        <span class="range">{words.withoutTrips(percent(book.weighted_error), gain)}</span>
      </p>
      {trend.course.length > 1 && <Line of={trend} />}
      {before !== null && now !== null && (
        <p class="range note">{words.errorBefore(trips, percent(now), percent(before))}</p>
      )}
    </div>
  );
}

/** Why the ranges are wider than they need to be, and what to switch on. */
function WhyWide({ of }: { of: OwnCar }) {
  const { ownCars: words } = text.value;
  const { flat, withoutAir, isYoung } = reasonsOf(of.diary, of.in_diary);
  const reasons = [
    flat > 0 && words.withoutHeights(flat, of.diary.length),
    withoutAir > 0 && words.withoutAir(withoutAir, of.diary.length),
    isYoung && words.young(of.in_diary),
  ].filter((reason) => reason !== false);
  if (reasons.length === 0) return null;
  return (
    <>
      <h3>{words.whyWide}</h3>
      <ul class="findings">
        {reasons.map((reason) => (
          <li key={reason}>{reason}</li>
        ))}
      </ul>
    </>
  );
}

function Progress({ of }: { of: OwnCar }) {
  const { ownCars: words } = text.value;
  const { learning } = of;
  if (!learning) return null;
  if (learning.state === "running") {
    const { done, total } = learning;
    return (
      <div class="learning" role="status">
        <label>
          {total === null ? words.starting : words.learning(done, total)}{" "}
          <progress value={total === null ? undefined : done} max={total ?? 1} />
        </label>
      </div>
    );
  }
  if (learning.state === "failed") return <FaultList faults={learning.faults} />;
  return (
    <p class="note" role="status">
      {words.learnedNow(learning.entries ?? 0, learning.known ?? 0)}{" "}
      {learning.flat ? words.flat(learning.flat) : ""}
    </p>
  );
}

export function OwnCarDiary({ of }: { of: OwnCar }) {
  const { ownCars: words } = text.value;
  const { score } = of;
  const reasons = Object.entries(of.left_out).map(([trip, why]) => said(`${trip}: ${why}`).text);
  return (
    <section aria-labelledby="own-car-diary">
      <Progress of={of} />
      {reasons.length > 0 && (
        <Fold title={words.tripsOut(reasons.length)}>
          <p class="note">{format.value.list(reasons)}</p>
        </Fold>
      )}
      {of.in_diary === 0 ? (
        of.learning?.state !== "running" && <p>{words.nothingYet}</p>
      ) : (
        <>
          <h3 id="own-car-diary">{words.learnedFrom(of.in_diary)}</h3>
          <Gain of={of} />
          <WhyWide of={of} />
          <Learned of={of} />
          <h3>{words.diary}</h3>
          <p class="note">
            {words.score(
              percent(score.weighted_error),
              score.inside,
              score.trips,
              percent(score.width),
              score.needed_width === null ? "" : percent(score.needed_width),
            )}{" "}
            {score.needed_width !== null && <span class="of-picture">{words.brackets}</span>}
          </p>
          <Trips of={of} />
          <Seasons of={of} />
        </>
      )}
    </section>
  );
}
