/** A car on the road, in large figures for a phone in a holder. */

import type { ComponentChildren } from "preact";
import type { LiveCar, LiveForecast } from "../api/documents";
import { CourseChart } from "../charts/course";
import { interpolate } from "../model/interpolate";
import { verdictOf } from "../model/arrival";
import { ENERGY, PERCENT, POWER } from "../model/units";
import {
  awake,
  closeRoad,
  followed,
  isOpen,
  link,
  live,
  night,
  planFailed,
  quietS,
  roadCars,
  toggleNight,
} from "../state/live-drive";
import { beginJourney } from "../state/catalogue";
import { labelOf, openOwnCars } from "../state/own-cars";
import { format, text, units } from "../state/preferences";
import { canPlan, planFromPage } from "../state/road-plan";
import { trip } from "../state/trip";
import { Chance } from "./chance";
import { Icon } from "./icons";
import { Button, IconButton, put, Row, Stat, useModal } from "./parts";
import { chanceInFigures, clockText, endsOf, range, rangeWithUnit, tripTitle } from "./wording";
import { Said } from "./said";
import { Warnings } from "./warnings";

/** A car that sent nothing for so long may have lost its connection [s]. */
const OLD_S = 120;
/** Before this distance a consumption says nothing [m]. */
const SHORT_M = 500;
const CONTRADICTED = "charge_contradicted";
const CHART_PX = 150;

function Arrival({ of, label }: { of: LiveForecast; label: string }) {
  const { result } = text.value;
  return (
    <>
      <p class="arrival" aria-live="polite">
        <span class="label">{label}</span>
        <span class="number">
          {format.value.figure(PERCENT.from(Math.max(0, of.soc_arrival)), 0)}
          <small>{PERCENT.unit}</small>
        </span>
        <span class="range">{result.inTrips(rangeWithUnit(endsOf(of.soc_quantiles), PERCENT))}</span>
      </p>
      <Chance
        verdict={verdictOf(of.p_arrive)}
        chance={of.p_arrive}
        reserve={of.reserve}
        atAll={of.p_arrive_at_all}
      />
    </>
  );
}

/** What to do now: nothing, drive slower, or charge. */
function Todo({ of }: { of: LiveCar }) {
  const { live: words } = text.value;
  if (!of.message) return null;
  const { verdict, speed_m_s, p_at_speed } = of.message;
  const slower =
    speed_m_s !== null &&
    words.slower(format.value.shown(speed_m_s, units.value.speed), chanceInFigures(p_at_speed ?? 0));
  return (
    <p class="todo" aria-live="polite">
      <Icon name={verdict === "arrives" ? "check" : "warning"} />
      <strong>{verdict === "arrives" ? words.asPlanned : slower || words.charge}</strong>
    </p>
  );
}

/** The plan of the departure beside the trip as it is now. */
function Course({ of, carM }: { of: LiveForecast; carM: number }) {
  const { live: words } = text.value;
  const at = (curve: number[]) => format.value.shown(interpolate(carM, of.course.distance_m, curve), PERCENT);
  const [now, planned] = [at(of.course.expected), at(of.course.planned)];
  return (
    <figure class="course">
      <figcaption>{now === planned ? words.onPlan : words.offPlan(now, planned)}</figcaption>
      <CourseChart of={of} carM={carM} height={CHART_PX} label={words.course} isNight={night.value} />
    </figure>
  );
}

/** What the car measured on its trip, with or without a plan. */
function Measured({ trip }: { trip: NonNullable<LiveCar["trip"]> }) {
  const { live: words } = text.value;
  const { figure, shown } = format.value;
  const { consumption, distance } = units.value;
  const { distance_m, energy_wh, power_w } = trip;
  return (
    <>
      <Stat label={words.driven}>{shown(distance_m, distance)}</Stat>
      {energy_wh !== null && <Stat label={words.used}>{shown(energy_wh, ENERGY, 1)}</Stat>}
      {energy_wh !== null && energy_wh > 0 && distance_m >= SHORT_M && (
        <Stat label={text.value.result.consumption}>
          {figure(consumption.from(energy_wh / distance_m), consumption.digits)}{" "}
          <small>{consumption.unit}</small>
        </Stat>
      )}
      {power_w !== null && <Stat label={words.power}>{shown(power_w, POWER)}</Stat>}
    </>
  );
}

/** Gives the car the trip of the page. */
function PlanButton() {
  const { live: words } = text.value;
  if (!canPlan.value || !trip.value) return null;
  return (
    <p>
      <Button
        class="primary"
        icon="road"
        onClick={() => void planFromPage()}
        label={words.usePlan(tripTitle(trip.value))}
      />
      {planFailed.value && (
        <span class="faults" role="alert">
          {" "}
          {words.planFailed}
        </span>
      )}
    </p>
  );
}

/** What a car without a forecast shows in its place. */
function Instead({ of }: { of: LiveCar }) {
  const { live: words } = text.value;
  if (of.seconds_since_message === null) return <Empty title={words.noMessage}>{words.noMessageHint}</Empty>;
  if (of.trip === null) return <Empty title={words.noTrip}>{words.noTripHint}</Empty>;
  return <Empty title={words.noPlan}>{words.noPlanHint}</Empty>;
}

function Empty({ title, children }: { title: string; children: ComponentChildren }) {
  return (
    <div class="empty">
      <p>
        <strong>{title}</strong>
      </p>
      <p>{children}</p>
    </div>
  );
}

/** When the car arrives, if it drives the rest as planned. */
function arrivalOf({ seconds_since_message: ago }: LiveCar, of: LiveForecast): Date {
  const leftS = Math.max(0, of.duration_s - of.measured_until_s) - (ago ?? 0);
  return new Date(Date.now() + 1000 * leftS);
}

function Car({ of }: { of: LiveCar }) {
  const { live: words, result } = text.value;
  const { shown } = format.value;
  const { forecast, trip, soc, destination } = of;
  const carM = forecast && trip ? Math.min(trip.distance_m, forecast.distance_m) : null;
  const { distance_m = [], expected = [] } = forecast?.course ?? {};
  const socNow = soc ?? (carM === null ? null : interpolate(carM, distance_m, expected));
  const flags = [...of.flags, ...(forecast?.flags.filter(({ code }) => code === CONTRADICTED) ?? [])];
  return (
    <>
      <div class="answer">
        {forecast ? (
          <Arrival
            of={forecast}
            label={destination ? words.arrivalAt(destination) : trip ? result.onArrival : words.nextTrip}
          />
        ) : (
          <Instead of={of} />
        )}
        {forecast && <Todo of={of} />}
      </div>
      <div class="answer">
        {forecast && carM !== null && <Course of={forecast} carM={carM} />}
        <dl class="stats">
          <Stat label={text.value.drive.now}>{socNow === null ? "–" : shown(socNow, PERCENT)}</Stat>
          {forecast && carM !== null && (
            <>
              <Stat label={text.value.verdict.arrivesAt}>
                {clockText(arrivalOf(of, forecast), new Date())}
              </Stat>
              <Stat label={words.left}>{shown(forecast.distance_m - carM, units.value.distance)}</Stat>
            </>
          )}
          {trip && <Measured trip={trip} />}
          {forecast && (
            <Stat label={words.whole}>
              {shown(forecast.energy_wh, ENERGY, 1)}{" "}
              <small>{range(endsOf(forecast.quantiles_wh), ENERGY, 1)}</small>
            </Stat>
          )}
        </dl>
        {flags.length > 0 && <Warnings flags={flags} serious={null} />}
        {of.plan !== "given" && <PlanButton />}
        {of.plan === "usual" && <p class="note">{words.usual}</p>}
        {of.faults.length > 0 && (
          <p class="faults">
            {words.notIn} <Said of={of.faults.map(({ what }) => what).join("; ")} />
          </p>
        )}
      </div>
    </>
  );
}

function ageText(seconds: number | null): string {
  const { live: words } = text.value;
  if (seconds === null) return words.noMessage;
  return seconds < 60 ? words.justNow : words.minutesAgo(Math.floor(seconds / 60));
}

/** Age of the last message, the connection and the screen. */
function Status() {
  const { live: words } = text.value;
  const quiet = quietS.value;
  const isOld = quiet !== null && quiet >= OLD_S;
  return (
    <ul class="status">
      {live.value && (
        <li class={isOld ? "old" : ""}>
          {quiet !== null && <Icon name={isOld ? "warning" : "check"} />}
          {ageText(quiet)}
        </li>
      )}
      <li class={link.value === "open" ? "" : "old"}>
        <span role="status">{words.links[link.value]}</span>
      </li>
      {awake.value !== null && <li>{awake.value ? words.awake : words.notAwake}</li>}
    </ul>
  );
}

/** Close the view, and go on elsewhere. */
const leaveFor = (next: () => void) => () => {
  closeRoad();
  next();
};

function Choose() {
  const { live: words } = text.value;
  const rows = roadCars.value;
  if (rows === null) return <p class="empty">{words.links[link.value]}</p>;
  if (rows.length === 0) {
    return (
      <>
        <Empty title={words.noCar}>{words.noCarHint}</Empty>
        <div class="actions">
          <Button class="primary" onClick={leaveFor(beginJourney)} label={words.plan} />
          <Button onClick={leaveFor(openOwnCars)} label={text.value.ownCars.title} />
        </div>
      </>
    );
  }
  return (
    <ul class="examples">
      {rows.map((row) => (
        <Row key={row.car} onClick={put(followed, row.car)} label={labelOf(row.car)}>
          {row.trip ? words.onTrip : ageText(row.seconds_since_message)}
        </Row>
      ))}
    </ul>
  );
}

export function LiveDrive() {
  const dialog = useModal(isOpen.value);
  const { live: words } = text.value;
  const several = followed.value !== "" && (roadCars.value?.length ?? 0) > 1;
  return (
    <dialog
      ref={dialog}
      class={`road${night.value ? " night" : ""}`}
      aria-labelledby="road-title"
      onClose={closeRoad}
    >
      <div class="heading">
        <h2 id="road-title">{followed.value ? labelOf(followed.value) : words.title}</h2>
        {several && <Button class="link" onClick={put(followed, "")} label={text.value.ownCars.all} />}
        <Button icon="moon" aria-pressed={night.value} onClick={toggleNight} label={words.night} />
        <IconButton icon="close" label={text.value.close} onClick={closeRoad} />
      </div>
      {isOpen.value && (
        <>
          <div class="scene">
            {!followed.value ? (
              <Choose />
            ) : link.value === "gone" ? (
              <Empty title={words.gone}>{words.goneHint}</Empty>
            ) : live.value ? (
              <Car of={live.value} />
            ) : (
              <p class="empty">{words.links[link.value]}</p>
            )}
          </div>
          {followed.value && <Status />}
        </>
      )}
    </dialog>
  );
}
