import type { ComponentChildren } from "preact";
import type { Forecast, Problem } from "../api/documents";
import { BatteryChart } from "../charts/battery";
import { RoadChart } from "../charts/road";
import { FAILED, UNREACHABLE } from "../api/client";
import {
  arrivalBand,
  chanceAtAll,
  chanceOf,
  decisiveClimbM,
  emptyAfterM,
  likelihoodOf,
  verdictOf,
} from "../model/arrival";
import { ENERGY, PERCENT } from "../model/units";
import { loading, retry } from "../state/catalogue";
import { shownForecast, arrived, canDrive, driving, shownProfile, driveObstacle } from "../state/drive";
import { alternative, requested, type Mode, mode, PAGE_ERROR, problem } from "../state/forecast";
import { map } from "../state/journey";
import { format, text, units, wholeBattery } from "../state/preferences";
import { trip } from "../state/trip";
import { Choice } from "./choice";
import { CompareControls, CompareLine } from "./compare";
import { DriveControls, DriveLine } from "./drive";
import { Icon } from "./icons";
import { JourneyAnswer, LeaveAnswer } from "./journey-answer";
import { PositionSlider } from "./position-slider";
import { RouteTable } from "./tables";
import { Warnings } from "./warnings";
import { bandText, chanceInFigures } from "./wording";

const MODES: Mode[] = ["plan", "compare", "drive"];

/** A higher chance is not put into words where a climb that nobody knows would change it. */
const MOST_UNCERTAIN = 0.9;

function Chance({ of }: { of: Forecast }) {
  const reserve = requested.value.at.reserve;
  const chance = chanceOf(of, reserve);
  if (chance === null) return null;
  const climb = decisiveClimbM(of, reserve);
  // Not good where a climb that nobody knows would change it.
  const certain = climb === null;
  const verdict = !certain && verdictOf(chance) === "good" ? "open" : verdictOf(chance);
  const likelihood = !certain && chance > MOST_UNCERTAIN ? "veryLikely" : likelihoodOf(chance);
  const { words, withReserve, withCharge, unlessClimb, atAll } = text.value.chance;
  const { shown } = format.value;
  return (
    <p class={`chance chance-${verdict}`}>
      <Icon name={verdict === "good" ? "check" : "warning"} />
      <span>
        <strong>{words[likelihood]}</strong>
        {reserve > 0 ? withReserve(shown(reserve, PERCENT)) : withCharge}
        <span class="figures"> · {chanceInFigures(chance)}</span>
        {climb !== null && <span class="figures"> · {unlessClimb(shown(climb, units.value.height, 0))}</span>}
        {reserve > 0 && <span class="at-all">{atAll(chanceInFigures(chanceAtAll(of)))}</span>}
      </span>
    </p>
  );
}

/** Where a battery that is expected to run empty does so, and what it lacks. */
function Empty({ of, afterM }: { of: Forecast; afterM: number }) {
  const { result } = text.value;
  const { figure, shown } = format.value;
  const { early, late } = of.empty_at_m;
  const { least, expected, most } = of.missing_wh;
  const [, best] = arrivalBand(of);
  const { distance } = units.value;
  const ends =
    late === null ? "" : result.emptyBetween(figure(distance.from(early ?? 0), 0), shown(late, distance, 0));
  const range = result.range(figure(ENERGY.from(least), 1), figure(ENERGY.from(most), 1));
  return (
    <>
      {result.emptyAfter(shown(afterM, distance, 0))}
      {ends}
      <span class="missing">{result.missing(shown(expected, ENERGY), range)}</span>
      {best >= 0.005 && <span class="missing">{result.atBest(shown(best, PERCENT))}</span>}
    </>
  );
}

function Headline({ of }: { of: Forecast }) {
  const emptyM = emptyAfterM(of);
  const measured = driving.value && arrived.value;
  const { result } = text.value;
  const { figure } = format.value;
  const detail = measured ? result.measured : result.inTrips(bandText(of));
  return (
    <div class="headline">
      <p class="arrival">
        <span class="label">{result.onArrival}</span>
        <span class="number">
          {figure(emptyM === null ? PERCENT.from(of.soc_arrival) : 0, 0)}
          <small>{PERCENT.unit}</small>
        </span>
        <span class="range">{emptyM === null ? detail : <Empty of={of} afterM={emptyM} />}</span>
      </p>
      {!measured && <Chance of={of} />}
    </div>
  );
}

function Stat({ label, children }: { label: string; children: ComponentChildren }) {
  return (
    <div>
      <dt>{label}</dt>
      <dd>{children}</dd>
    </div>
  );
}

function Stats({ of }: { of: Forecast }) {
  const distance = of.series.distance_m.at(-1) as number;
  const q = of.quantiles_wh;
  const { result } = text.value;
  const { duration, figure, shown } = format.value;
  const [low, high] = ["0.05", "0.95"].map((p) => figure(ENERGY.from(q[p] as number), 2)) as [string, string];
  const { consumption } = units.value;
  return (
    <dl class="stats">
      <Stat label={result.energy}>
        {shown(of.energy_wh, ENERGY)} <small>{result.range(low, high)}</small>
      </Stat>
      <Stat label={result.consumption}>{shown(of.energy_wh / distance, consumption)}</Stat>
      <Stat label={result.distance}>{shown(distance, units.value.distance)}</Stat>
      <Stat label={result.time}>{duration(of.series.time_s.at(-1) as number)}</Stat>
    </dl>
  );
}

function Legend() {
  const { result } = text.value;
  return (
    <ul class="legend" aria-hidden="true">
      {driving.value && <li class="key-driven">{result.driven}</li>}
      <li class="key-main">{mode.value === "compare" ? result.first : result.forecast}</li>
      {alternative.value && <li class="key-other">{result.second}</li>}
      <li class="key-core">{result.half}</li>
      <li class="key-band">{result.band}</li>
      {driving.value && <li class="key-before">{result.atDeparture}</li>}
    </ul>
  );
}

function Given() {
  const { givenPlanned, givenDriven } = text.value.result;
  const planned = trip.value?.links ?? trip.value?.stops;
  return <p class="given">{planned ? givenPlanned : givenDriven}</p>;
}

/** Title and detail of a problem; `isRaw` when the detail is an English text of the service. */
function problemText({ type, title, detail: given }: Problem): {
  title: string;
  detail: string;
  isRaw: boolean;
} {
  const { problems } = text.value;
  const detail = given ?? "";
  if (type === UNREACHABLE) {
    return { title: problems.unreachable, detail: problems.unreachableHint, isRaw: false };
  }
  if (type === PAGE_ERROR) return { title: problems.page, detail, isRaw: true };
  if (type === FAILED) return { title: problems.failed, detail: title, isRaw: true };
  const titles: Record<string, string> = problems.titles;
  return { title: titles[type?.split("/").at(-1) ?? ""] ?? title, detail, isRaw: true };
}

function Failure() {
  const failure = problem.value;
  if (!failure) return null;
  const { problems } = text.value;
  const { title, detail, isRaw } = problemText(failure);
  return (
    <div class="failure" role="alert">
      <Icon name="warning" />
      <div>
        <strong>{title}</strong>
        {failure.faults?.length ? (
          <p>{problems.seeFields}</p>
        ) : (
          <p {...(isRaw && { lang: "en" })}>{detail}</p>
        )}
      </div>
      <button type="button" onClick={retry}>
        {failure.faults?.length ? problems.close : problems.retry}
      </button>
    </div>
  );
}

function Waiting() {
  if (problem.value) return null;
  const { result } = text.value;
  const nothing = loading.value === null && !trip.value;
  return nothing ? (
    <div class="empty">
      <Icon name="road" />
      <p>
        <strong>{result.noTrip}</strong> {map.value ? result.noJourneyHint : result.noTripHint}
      </p>
    </div>
  ) : (
    <div class="skeleton" aria-hidden="true">
      <span />
      <span />
      <span />
    </div>
  );
}

function chartLabel(of: Forecast): string {
  const { shown } = format.value;
  const from = shown(of.series.displayed_soc[0] as number, PERCENT);
  return text.value.result.chart(from, shown(of.soc_arrival, PERCENT), bandText(of));
}

function RoadHeading() {
  const { speed, height } = units.value;
  const { result } = text.value;
  const hilly = shownProfile.value?.elevationM != null;
  return (
    <ul class="legend road-legend" aria-hidden="true">
      <li class="key-speed">{result.speedIn(speed.unit)}</li>
      {hilly && <li class="key-ground">{result.elevationIn(height.unit)}</li>}
    </ul>
  );
}

function Picture({ of }: { of: Forecast }) {
  const { result } = text.value;
  const tall = matchMedia("(min-width: 700px)").matches;
  return (
    <figure>
      <figcaption>
        <h3>{result.alongTheWay}</h3>
        <Legend />
        <label class="tick">
          <input
            type="checkbox"
            checked={wholeBattery.value}
            onChange={(event) => {
              wholeBattery.value = event.currentTarget.checked;
            }}
          />
          {result.wholeBattery}
        </label>
      </figcaption>
      <BatteryChart height={tall ? 320 : 240} label={chartLabel(of)} />
      <RoadHeading />
      <RoadChart height={tall ? 160 : 130} label={result.roadChart} />
      <PositionSlider of={of} />
    </figure>
  );
}

export function Result() {
  const now = shownForecast.value;
  const others = alternative.value?.flags ?? [];
  const { result } = text.value;
  return (
    <section class="card result" aria-labelledby="result-title" aria-busy={!now}>
      <div class="heading">
        <h2 id="result-title" class="unseen">
          {result.title}
        </h2>
        <Choice
          label={result.mode}
          class="modes"
          value={mode.value}
          options={MODES.map((name) => [name, result.modes[name]] as const)}
          disabled={canDrive.value ? [] : ["drive"]}
          onChoose={(value) => {
            mode.value = value;
          }}
        />
        {trip.value && driveObstacle.value && <p class="note">{result[driveObstacle.value]}</p>}
      </div>
      {mode.value === "compare" && <CompareControls />}
      <Failure />
      {now ? (
        <>
          {mode.value === "compare" && alternative.value ? (
            <CompareLine first={now} second={alternative.value} />
          ) : (
            <Headline of={now} />
          )}
          <JourneyAnswer />
          {!driving.value && mode.value === "plan" && <LeaveAnswer />}
          <Warnings flags={now.flags} others={others} serious />
          {driving.value && <DriveLine of={now} />}
          {driving.value && <DriveControls />}
          <Picture of={now} />
          {mode.value !== "compare" && <Stats of={now} />}
          <Given />
          <Warnings flags={now.flags} others={others} serious={false} />
          <RouteTable of={now} />
        </>
      ) : (
        <Waiting />
      )}
    </section>
  );
}
