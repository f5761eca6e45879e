import type { ComponentChildren } from "preact";
import type { Answer } from "../api/types";
import { BatteryChart } from "../charts/battery";
import { RoadChart } from "../charts/road";
import {
  arrivalBand,
  chanceInFigures,
  chanceInWords,
  chanceOf,
  emptyAfterM,
  verdictOf,
} from "../model/arrival";
import { duration, ENERGY, figure, PERCENT, shown } from "../model/units";
import { loading, retry } from "../state/catalogue";
import { answer, arrived, canDrive, driving, road, whyNoDrive } from "../state/drive";
import { alternative, asked, type Mode, mode, problem } from "../state/forecast";
import { units, wholeBattery } from "../state/preferences";
import { trip } from "../state/trip";
import { Choice } from "./choice";
import { CompareControls, CompareLine } from "./compare";
import { DriveControls, DriveLine } from "./drive";
import { Icon } from "./icons";
import { Place } from "./place";
import { RouteTable } from "./tables";
import { Warnings } from "./warnings";

const MODES: [Mode, string][] = [
  ["plan", "Plan"],
  ["compare", "Compare"],
  ["drive", "Drive"],
];

/** Both ends of the band, with the unit once. */
export function bandText(of: Answer, digits = 0): string {
  const [low, high] = arrivalBand(of).map((soc) => figure(PERCENT.from(soc), digits));
  return low === high ? `${low} %` : `${low} to ${high} %`;
}

function Chance({ of }: { of: Answer }) {
  const reserve = asked.value.at.reserve;
  const chance = chanceOf(of, reserve);
  if (chance === null) return null;
  return (
    <p class={`chance chance-${verdictOf(chance)}`}>
      <Icon name={verdictOf(chance) === "good" ? "check" : "warning"} />
      <span>
        <strong>{chanceInWords(chance)}</strong> to arrive with{" "}
        {reserve > 0 ? `the reserve of ${shown(reserve, PERCENT)} or more` : "charge left"}
        <span class="figures"> · {chanceInFigures(chance)}</span>
      </span>
    </p>
  );
}

function Headline({ of }: { of: Answer }) {
  const emptyM = emptyAfterM(of);
  const measured = driving.value && arrived.value;
  const said = measured ? "measured" : `${bandText(of)} in 9 of 10 trips like this`;
  return (
    <div class="headline">
      <p class="arrival">
        <span class="label">Battery on arrival</span>
        <span class="number">
          {emptyM === null ? figure(PERCENT.from(of.soc_arrival), 0) : "0"}
          <small>%</small>
        </span>
        <span class="range">
          {emptyM === null ? said : `Empty after about ${shown(emptyM, units.value.distance, 0)}`}
        </span>
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

function Stats({ of }: { of: Answer }) {
  const distance = of.series.distance_m.at(-1) as number;
  const q = of.quantiles_wh;
  const [low, high] = [q["0.05"] as number, q["0.95"] as number].map((wh) => figure(ENERGY.from(wh), 2));
  const { consumption } = units.value;
  return (
    <dl class="stats">
      <Stat label="Energy">
        {shown(of.energy_wh, ENERGY)} <small>{`${low} to ${high}`}</small>
      </Stat>
      <Stat label="Consumption">{shown(of.energy_wh / distance, consumption)}</Stat>
      <Stat label="Distance">{shown(distance, units.value.distance)}</Stat>
      <Stat label="Time">{duration(of.series.time_s.at(-1) as number)}</Stat>
    </dl>
  );
}

function Legend() {
  return (
    <ul class="legend" aria-hidden="true">
      {driving.value && <li class="key-driven">driven</li>}
      <li class="key-main">{mode.value === "compare" ? "first" : "forecast"}</li>
      {alternative.value && <li class="key-other">second</li>}
      <li class="key-core">half of all trips</li>
      <li class="key-band">9 of 10</li>
      {driving.value && <li class="key-before">at departure</li>}
    </ul>
  );
}

function Given({ of }: { of: Answer }) {
  const planned = trip.value?.links != null;
  return (
    <p class="given">
      {`Given ${of.given}: `}
      {planned
        ? "speeds between the ends of a link are those of a driver model."
        : "how fast the trip is driven is taken as known."}
    </p>
  );
}

function Failure() {
  const found = problem.value;
  if (!found) return null;
  return (
    <div class="failure" role="alert">
      <Icon name="warning" />
      <div>
        <strong>{found.title}</strong>
        <p>{found.faults?.length ? "What is wrong stands beside its field." : found.detail}</p>
      </div>
      <button type="button" onClick={retry}>
        {found.faults?.length ? "Close" : "Try again"}
      </button>
    </div>
  );
}

function Waiting() {
  if (problem.value) return null;
  const nothing = !loading.value && !trip.value;
  return nothing ? (
    <div class="empty">
      <Icon name="road" />
      <p>
        <strong>No trip yet.</strong> Upload a track or paste links to see its battery.
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

function chartLabel(of: Answer): string {
  const from = shown(of.series.displayed_soc[0] as number, PERCENT);
  return `Battery along the way: from ${from} at departure to ${shown(of.soc_arrival, PERCENT)} on arrival, ${bandText(of)} in 9 of 10 trips`;
}

function RoadHeading() {
  const { speed, height } = units.value;
  const hilly = road.value?.elevationM != null;
  return (
    <ul class="legend road-legend" aria-hidden="true">
      <li class="key-speed">speed, {speed.unit}</li>
      {hilly && <li class="key-ground">elevation, {height.unit}</li>}
    </ul>
  );
}

function Picture({ of }: { of: Answer }) {
  const tall = matchMedia("(min-width: 700px)").matches;
  return (
    <figure>
      <figcaption>
        <h3>Battery along the way</h3>
        <Legend />
        <label class="tick">
          <input
            type="checkbox"
            checked={wholeBattery.value}
            onChange={(event) => {
              wholeBattery.value = event.currentTarget.checked;
            }}
          />
          0 to 100 %
        </label>
      </figcaption>
      <BatteryChart height={tall ? 320 : 240} label={chartLabel(of)} />
      <RoadHeading />
      <RoadChart
        height={tall ? 160 : 130}
        label="Speed and elevation along the way; the table has their values"
      />
      <Place of={of} />
    </figure>
  );
}

export function Result() {
  const now = answer.value;
  const others = alternative.value?.flags ?? [];
  return (
    <section class="card result" aria-labelledby="result-title" aria-busy={!now}>
      <div class="heading">
        <h2 id="result-title" class="unseen">
          Forecast
        </h2>
        <Choice
          label="What to do with the trip"
          class="modes"
          value={mode.value}
          options={MODES}
          disabled={canDrive.value ? [] : ["drive"]}
          onChoose={(value) => {
            mode.value = value;
          }}
        />
        {trip.value && whyNoDrive.value && <p class="note">{whyNoDrive.value}</p>}
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
          <Warnings flags={now.flags} others={others} serious />
          {driving.value && <DriveLine of={now} />}
          {driving.value && <DriveControls />}
          <Picture of={now} />
          {mode.value !== "compare" && <Stats of={now} />}
          <Given of={now} />
          <Warnings flags={now.flags} others={others} serious={false} />
          <RouteTable of={now} />
        </>
      ) : (
        <Waiting />
      )}
    </section>
  );
}
