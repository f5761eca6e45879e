import type { Forecast } from "../api/documents";
import { BatteryChart } from "../charts/battery";
import { RoadChart } from "../charts/road";
import { ENERGY, PERCENT } from "../model/units";
import { source } from "../state/catalogue";
import { answer } from "../state/answer";
import { chargingPlan } from "../state/charging";
import { shownForecast, canDrive, driving, shownProfile, driveObstacle } from "../state/drive";
import { alternative, type Mode, mode } from "../state/forecast";
import { format, text, units, wholeBattery } from "../state/preferences";
import { trip } from "../state/trip";
import { Choice } from "./choice";
import { CompareControls } from "./compare";
import { DriveControls, DriveLine } from "./drive";
import { into, Stat, Tick } from "./parts";
import { PositionSlider } from "./position-slider";
import { RouteTable } from "./tables";
import { endsOf, range, rangeWithUnit } from "./wording";

const MODES: Mode[] = ["plan", "compare", "drive"];

function Stats({ of }: { of: Forecast }) {
  const distance = of.series.distance_m.at(-1) as number;
  const { result } = text.value;
  const { duration, shown } = format.value;
  return (
    <dl class="stats">
      <Stat label={result.energy}>
        {shown(of.energy_wh, ENERGY)} <small>{range(endsOf(of.quantiles_wh), ENERGY)}</small>
      </Stat>
      <Stat label={result.consumption}>{shown(of.energy_wh / distance, units.value.consumption)}</Stat>
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

function chartLabel(of: Forecast): string {
  const { shown } = format.value;
  const from = shown(of.series.displayed_soc[0] as number, PERCENT);
  const { soc, interval } = answer.value ?? { soc: of.soc_arrival, interval: [0, 1] as const };
  return text.value.result.chart(from, shown(soc, PERCENT), rangeWithUnit(interval, PERCENT));
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
        <Tick label={result.wholeBattery} checked={wholeBattery.value} onChange={into(wholeBattery)} />
      </figcaption>
      <BatteryChart height={tall ? 320 : 240} label={chartLabel(of)} />
      {!chargingPlan.value && <RoadHeading />}
      {!chargingPlan.value && <RoadChart height={tall ? 160 : 130} label={result.roadChart} />}
      <PositionSlider />
    </figure>
  );
}

export function Result() {
  const now = shownForecast.value;
  const { result } = text.value;
  if (!now || source.value === "distance") return null;
  const plan = chargingPlan.value;
  return (
    <section class="card result" aria-labelledby="result-title">
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
          onChoose={into(mode)}
        />
        {trip.value && driveObstacle.value && <p class="note">{result[driveObstacle.value]}</p>}
      </div>
      {mode.value === "compare" && <CompareControls />}
      {driving.value && <DriveLine of={now} />}
      {driving.value && <DriveControls />}
      <Picture of={now} />
      {mode.value !== "compare" && !plan && <Stats of={now} />}
      {!plan && <RouteTable of={now} />}
    </section>
  );
}
