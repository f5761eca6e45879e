/** A car on the road, in large figures for a phone in a holder. */

import type { ComponentChildren } from "preact";
import type { LiveCar, LiveForecast } from "../api/documents";
import { verdictOf } from "../model/arrival";
import { ENERGY, PERCENT } from "../model/units";
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
import { labelOf } from "../state/own-cars";
import { format, text, units } from "../state/preferences";
import { canPlan, planFromPage } from "../state/road-plan";
import { trip } from "../state/trip";
import { Chance } from "./chance";
import { Icon } from "./icons";
import { openOwnCars } from "./own-cars-dialog";
import { Button, IconButton, put, Stat, useModal } from "./parts";
import { chanceInFigures, tripTitle } from "./wording";
import { Said } from "./said";
import { Warnings } from "./warnings";

/** A car that sent nothing for so long may have lost its connection [s]. */
const OLD_S = 120;
const LOW = "0.05";
const HIGH = "0.95";

function Arrival({ of, label }: { of: LiveForecast; label: string }) {
  const { result } = text.value;
  const { figure } = format.value;
  const low = figure(PERCENT.from(of.soc_quantiles[LOW] ?? 0), 0);
  const high = figure(PERCENT.from(of.soc_quantiles[HIGH] ?? 0), 0);
  return (
    <>
      <p class="arrival" aria-live="polite">
        <span class="label">{label}</span>
        <span class="number">
          {figure(PERCENT.from(Math.max(0, of.soc_arrival)), 0)}
          <small>{PERCENT.unit}</small>
        </span>
        <span class="range">{result.inTrips(`${result.range(low, high)}\u00a0${PERCENT.unit}`)}</span>
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

/** Gives the car the trip of the page. */
function PlanButton() {
  const { live: words } = text.value;
  if (!canPlan.value || !trip.value) return null;
  return (
    <p>
      <button type="button" class="primary" onClick={() => void planFromPage()}>
        <Icon name="road" />
        {words.usePlan(tripTitle(trip.value))}
      </button>
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

function Car({ of }: { of: LiveCar }) {
  const { live: words, result } = text.value;
  const { figure, shown } = format.value;
  const { distance } = units.value;
  const { forecast, trip, soc } = of;
  const leftM = forecast && trip ? Math.max(0, forecast.distance_m - trip.distance_m) : null;
  const ends = (q: Record<string, number>) => [LOW, HIGH].map((p) => figure(ENERGY.from(q[p] ?? 0), 1));
  const [low = "", high = ""] = forecast ? ends(forecast.quantiles_wh) : [];
  return (
    <>
      {forecast ? (
        <Arrival of={forecast} label={trip ? result.onArrival : words.nextTrip} />
      ) : (
        <Instead of={of} />
      )}
      {of.message?.speed_m_s != null && (
        <p class="said" aria-live="polite">
          <strong>
            {words.slower(
              shown(of.message.speed_m_s, units.value.speed),
              chanceInFigures(of.message.p_at_speed ?? 0),
            )}
          </strong>
        </p>
      )}
      <dl class="stats">
        <Stat label={text.value.drive.now}>{soc === null ? "–" : shown(soc, PERCENT)}</Stat>
        {leftM !== null && <Stat label={words.left}>{shown(leftM, distance)}</Stat>}
        {trip && <Stat label={words.driven}>{shown(trip.distance_m, distance)}</Stat>}
        {forecast && (
          <Stat label={result.energy}>
            {shown(forecast.energy_wh, ENERGY, 1)} <small>{result.range(low, high)}</small>
          </Stat>
        )}
      </dl>
      {of.flags.length > 0 && <Warnings flags={of.flags} others={[]} serious={null} />}
      {of.plan !== "given" && <PlanButton />}
      {of.plan === "usual" && <p class="note">{words.usual}</p>}
      {of.faults.length > 0 && (
        <p class="faults">
          {words.notIn} <Said of={of.faults.map(({ what }) => what).join("; ")} />
        </p>
      )}
    </>
  );
}

function ageText(seconds: number): string {
  const { live: words } = text.value;
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
          {quiet === null ? words.noMessage : ageText(quiet)}
        </li>
      )}
      <li class={link.value === "open" ? "" : "old"}>
        <span role="status">{words.links[link.value]}</span>
      </li>
      {awake.value !== null && <li>{awake.value ? words.awake : words.notAwake}</li>}
    </ul>
  );
}

function Choose() {
  const { live: words } = text.value;
  const rows = roadCars.value;
  if (rows === null) return <p class="empty">{words.links[link.value]}</p>;
  if (rows.length === 0) {
    return (
      <>
        <Empty title={words.noCar}>{words.noCarHint}</Empty>
        <Button
          class="primary"
          onClick={() => {
            closeRoad();
            openOwnCars();
          }}
          label={text.value.ownCars.title}
        />
      </>
    );
  }
  return (
    <ul class="examples">
      {rows.map((row) => (
        <li key={row.car}>
          <button type="button" onClick={put(followed, row.car)}>
            <span class="name">{labelOf(row.car)}</span>
            <span class="figures">
              {row.on_trip
                ? words.onTrip
                : row.seconds_since_message === null
                  ? words.noMessage
                  : ageText(row.seconds_since_message)}
            </span>
          </button>
        </li>
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
        <button type="button" aria-pressed={night.value} onClick={toggleNight}>
          <Icon name="moon" />
          {words.night}
        </button>
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
