import { useEffect, useRef, useState } from "preact/hooks";
import { warningsOf } from "../model/flags";
import {
  chooseExample,
  chooseSource,
  chooseUpload,
  examples,
  loading,
  source,
  uploaded,
} from "../state/catalogue";
import { faults } from "../state/forecast";
import { isExample, map } from "../state/journey";
import { format, text, units, wording } from "../state/preferences";
import { type Source, type Trip, trip } from "../state/trip";
import { Choice } from "./choice";
import { Covers } from "./covers";
import { DistanceForm } from "./distance-form";
import { FaultList } from "./faults";
import { FileDrop } from "./file-drop";
import { isFormOpen, JourneyForm } from "./journey-form";
import { NumberField } from "./number-field";
import { tripTitle } from "./wording";
import { Said } from "./said";
import { Button, into, Row, useAsked } from "./parts";

const MAX_BYTES = 4_000_000;
const START_M_S = 50 / 3.6;
const SLOWEST_M_S = 5 / 3.6;
const FASTEST_M_S = 130 / 3.6;
const SOURCES: Source[] = ["distance", "examples", "upload", "links"];
const WITH_MAP: Source[] = ["journey", ...SOURCES];

function Examples() {
  const { shown } = format.value;
  return (
    <ul class="examples">
      {examples.value.map((row) => (
        <Row
          key={row.trip}
          aria-pressed={trip.value?.example === row.trip}
          onClick={() => void chooseExample(row.trip)}
          label={row.title}
        >
          {shown(row.distance_m, units.value.distance, 0)}
          {row.ambient_temperature_degc !== null &&
            ` · ${shown(row.ambient_temperature_degc, units.value.temperature)}`}
        </Row>
      ))}
    </ul>
  );
}

/** Kind of the trip. */
function kindText({ source, links }: Trip): string {
  const { trip } = text.value;
  if (source === "examples") return trip.recorded;
  if (source === "journey") return isExample.value ? trip.exampleOfMap : trip.plannedRoute;
  if (source === "distance") return trip.assumedRoute;
  return links ? trip.links(links.length) : trip.speedTrace;
}

function loadingText(): string {
  const now = loading.value;
  const { trip } = text.value;
  if (!now) return "";
  return now.what === "file" ? trip.loadingFile(now.name) : trip.loading[now.what];
}

/** Assumptions made when the trip was read. */
function Notes({ of }: { of: Trip }) {
  return warningsOf(of.notes, wording.value).map(({ text: note, isRaw }) => (
    <span key={note}>
      {" · "}
      {isRaw ? <Said of={note} /> : note}
    </span>
  ));
}

function Upload() {
  const [speedMS, setSpeed] = useState(START_M_S);
  const { trip: words } = text.value;
  return (
    <FileDrop
      label={words.chooseFile}
      formats={words.formats}
      accept=".gpx,.kml,.geojson,.json,.csv,.xml"
      mostBytes={MAX_BYTES}
      onFiles={([file]) => {
        if (file) void file.text().then((content) => chooseUpload({ content, name: file.name }, speedMS));
      }}
    >
      <div class="inline">
        <NumberField
          label={words.speedWithoutTimes}
          value={speedMS}
          quantity={units.value.speed}
          onChange={(next) => {
            const nextMS = Math.min(Math.max(next ?? START_M_S, SLOWEST_M_S), FASTEST_M_S);
            setSpeed(nextMS);
            const file = uploaded.value;
            if (file && trip.value?.source === "upload") void chooseUpload(file, nextMS);
          }}
        />
      </div>
    </FileDrop>
  );
}

/* eslint-disable page/text -- commands */
const BUILD = "tripwatt map build REGION.osm.pbf";
const SERVE = "tripwatt serve --map map";
/* eslint-enable page/text */

/** How journeys come to a service without a map. */
function NoMap() {
  return (
    <p class="note needs-map">
      {text.value.trip.needsMap} <code>{BUILD}</code>, <code>{SERVE}</code>
    </p>
  );
}

export function TripPanel() {
  const now = trip.value;
  const starts = source.value === "journey" && !now?.stops;
  const setOpen = into(isFormOpen);
  const open = isFormOpen.value || starts;
  const before = useRef<Source | undefined>(undefined);
  const places = now?.stops?.map(({ name }) => name).join(); // who ticks the way back goes on typing
  useEffect(() => {
    // a distance is there before it is typed, and a kind that is chosen again brings up its last trip
    const isFirst = !before.current && now && now.source !== "distance";
    if (isFirst || (now && now.source === before.current)) setOpen(false);
    before.current = now?.source;
  }, [now?.source, places ?? now?.title]);
  const wrong = faults.value.get("trip") ?? [];
  const isLinks = source.value === "links";
  const links = useAsked(async () => (isLinks ? import("./links-form") : null), [isLinks]);
  const { trip: words } = text.value;
  return (
    <section class={`panel trip${open ? " open" : ""}`} aria-labelledby="trip-title">
      <div class="heading">
        <h2 id="trip-title">{words.title}</h2>
        {!starts && (
          <Button
            class="link more"
            aria-expanded={open}
            onClick={() => setOpen(!open)}
            label={open ? text.value.close : words.change}
          />
        )}
      </div>
      <div class="ways">
        <Choice
          label={words.from}
          value={source.value}
          options={(map.value ? WITH_MAP : SOURCES).map((name) => [name, words.sources[name]] as const)}
          onChoose={(value) => {
            chooseSource(value);
            setOpen(true);
          }}
        />
        {!map.value && loading.value?.what !== "examples" && <NoMap />}
        {source.value === "journey" && <JourneyForm />}
        {source.value === "examples" && <Examples />}
        {source.value === "upload" && <Upload />}
        {source.value === "distance" && <DistanceForm />}
        {isLinks && links && <links.LinksForm />}
      </div>
      <FaultList faults={wrong} />
      {wrong.length > 0 && source.value === "journey" && (
        <p class="note outside">
          <Covers />
        </p>
      )}
      {now && (
        <p class="note">
          <strong>{tripTitle(now)}</strong> · {kindText(now)}
          <Notes of={now} />
        </p>
      )}
      {loading.value && <p class="note">{loadingText()}</p>}
    </section>
  );
}
