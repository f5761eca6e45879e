import { useEffect, useId, useState } from "preact/hooks";
import { sampleLinks } from "../model/sample-links";
import { shown } from "../model/units";
import { chooseExample, chooseRoute, examples, loading, source } from "../state/catalogue";
import { faults } from "../state/forecast";
import { units } from "../state/preferences";
import { type Source, trip } from "../state/trip";
import { Choice } from "./choice";
import { FaultList } from "./faults";
import { Icon } from "./icons";

const MAX_BYTES = 4_000_000;
const START_M_S = 50 / 3.6;
const TITLES: Record<string, string> = { city: "City", rural: "Country roads", mixed: "City and country" };

const SOURCES: [Source, string][] = [
  ["examples", "Examples"],
  ["upload", "Upload"],
  ["links", "Links"],
];

function Examples() {
  return (
    <ul class="examples">
      {examples.value.map((row) => (
        <li key={row.trip}>
          <button
            type="button"
            aria-pressed={trip.value?.example === row.trip}
            onClick={() => void chooseExample(row.trip)}
          >
            <span class="name">{titleOf(row.title)}</span>
            <span class="figures">
              {shown(row.distance_m, units.value.distance, 0)}
              {row.ambient_temperature_degc !== null &&
                ` · ${shown(row.ambient_temperature_degc, units.value.temperature)}`}
            </span>
          </button>
        </li>
      ))}
    </ul>
  );
}

export function titleOf(title: string): string {
  return TITLES[title] ?? title;
}

function Upload() {
  const [over, setOver] = useState(false);
  const [refused, setRefused] = useState("");
  const [speedMS, setSpeed] = useState(START_M_S);
  const { speed } = units.value;
  const id = useId();
  const take = async (file: File | undefined) => {
    if (!file) return;
    const tooLarge = file.size > MAX_BYTES;
    setRefused(tooLarge ? `${file.name} has more than ${MAX_BYTES / 1e6} MB` : "");
    if (!tooLarge) await chooseRoute(await file.text(), file.name, "upload", speedMS);
  };
  return (
    <div
      class={`drop${over ? " over" : ""}`}
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => setOver(false)}
      onDrop={(event) => {
        event.preventDefault();
        setOver(false);
        void take(event.dataTransfer?.files[0]);
      }}
    >
      <label class="file">
        <Icon name="upload" />
        <span class="name">Choose a file, or drop it here</span>
        <span class="figures">
          GPX, GeoJSON, CSV, or the saved answer of OSRM, Valhalla, openrouteservice or GraphHopper
        </span>
        <input
          type="file"
          accept=".gpx,.geojson,.json,.csv,.xml"
          onChange={(event) => {
            void take(event.currentTarget.files?.[0]);
            event.currentTarget.value = "";
          }}
        />
      </label>
      {refused && <p class="faults">{refused}</p>}
      <p class="inline">
        <label for={id}>Tracks without times, at</label>
        <input
          id={id}
          type="number"
          min={5}
          max={130}
          value={Math.round(speed.from(speedMS))}
          onChange={(event) => setSpeed(speed.to(event.currentTarget.valueAsNumber) || START_M_S)}
        />
        {speed.unit}
      </p>
    </div>
  );
}

function Links() {
  const [text, setText] = useState("");
  const id = useId();
  return (
    <form
      class="links"
      onSubmit={(event) => {
        event.preventDefault();
        const links = text || sampleLinks();
        setText(links);
        void chooseRoute(links, "Planned road", "links", START_M_S);
      }}
    >
      <label for={id}>Links or a router's answer, as JSON</label>
      <textarea
        id={id}
        rows={5}
        spellcheck={false}
        value={text}
        placeholder={'[{"length_m": 1800, "speed_m_s": 8.5}, …]'}
        onInput={(event) => setText(event.currentTarget.value)}
      />
      <button type="submit" class="primary">
        {text ? "Use these links" : "Try with an example"}
      </button>
    </form>
  );
}

export function TripPanel() {
  const now = trip.value;
  const [open, setOpen] = useState(false);
  useEffect(() => setOpen(false), [now]);
  const wrong = faults.value.get("trip") ?? [];
  return (
    <section class={`panel trip${open ? " open" : ""}`} aria-labelledby="trip-title">
      <div class="heading">
        <h2 id="trip-title">Trip</h2>
        <button type="button" class="link more" aria-expanded={open} onClick={() => setOpen(!open)}>
          {open ? "Close" : "Change"}
        </button>
      </div>
      <div class="ways">
        <Choice
          label="Where the trip comes from"
          value={source.value}
          options={SOURCES}
          onChoose={(value) => {
            source.value = value;
          }}
        />
        {source.value === "examples" && <Examples />}
        {source.value === "upload" && <Upload />}
        {source.value === "links" && <Links />}
      </div>
      <FaultList faults={wrong} />
      {now && (
        <p class="note">
          <strong>{titleOf(now.title)}</strong> · {now.note}
          {now.notes.map((note) => (
            <span key={note}> · {note}</span>
          ))}
        </p>
      )}
      {loading.value && <p class="note">Reading {loading.value} …</p>}
    </section>
  );
}
