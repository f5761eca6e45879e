import { batch, signal } from "@preact/signals";
import { useId, useRef, useState } from "preact/hooks";
import { findPlaces } from "../api/client";
import type { Place } from "../api/documents";
import { placeCalled } from "../model/places";
import { readCoordinates } from "../model/road";
import { chooseJourney } from "../state/catalogue";
import { faults, forgetStop, reportProblem, STOP_FIELDS } from "../state/forecast";
import {
  answersAreOld,
  type End,
  ends,
  journey,
  map,
  nextEnd,
  placeAt,
  setEnd,
  wantsFit,
} from "../state/journey";
import { text } from "../state/preferences";
import { FaultList } from "./faults";

const PAUSE_MS = 120;
// eslint-disable-next-line page/text -- names of keys
const [ENTER, ESCAPE] = ["Enter", "Escape"];

/** Places for a text: coordinates, or names where the service knows them. */
async function placesFor(words: string, signal: AbortSignal): Promise<Place[]> {
  const at = readCoordinates(words);
  if (at) return [placeAt(at.longitude_deg, at.latitude_deg)];
  return words.trim() && map.value?.places ? findPlaces(words, signal) : [];
}

const ENDS: End[] = ["from", "to"];
/** What is written in the fields, and what of it no place is called. */
const typed = signal<Record<End, string>>({ from: "", to: "" });
const unknown = signal<Record<End, string>>({ from: "", to: "" });
/** Places to choose from. */
const suggested = signal<Record<End, Place[]>>({ from: [], to: [] });

function suggest(end: End, places: Place[]): void {
  suggested.value = { ...suggested.value, [end]: places };
}

function write(end: End, words: string): void {
  typed.value = { ...typed.value, [end]: words };
  unknown.value = { ...unknown.value, [end]: "" };
  forgetStop(ENDS.indexOf(end));
}

/** Take the place whose whole name is written where none was taken; ask back where there is none, or several. */
async function resolve(end: End): Promise<void> {
  const words = typed.value[end].trim();
  if (ends.value[end] || !words) return;
  const places = await placesFor(words, new AbortController().signal);
  const meant = readCoordinates(words) ? places[0] : placeCalled(words, places);
  if (!meant) {
    unknown.value = { ...unknown.value, [end]: words };
    suggest(end, places);
    return;
  }
  batch(() => {
    write(end, meant.name);
    setEnd(end, meant);
  });
}

/** What a place is, in words. */
function kindOf({ kind }: Place): string {
  const kinds: Record<string, string> = text.value.journey.kinds;
  return kinds[kind] ?? kind.replaceAll("_", " ");
}

async function plan(): Promise<void> {
  try {
    await Promise.all(ENDS.map(resolve));
  } catch (error) {
    return reportProblem(error);
  }
  if (!ends.value.from || !ends.value.to) return;
  wantsFit.value = true;
  journey.value = null;
  chooseJourney();
}

/** A field that suggests places while one types: arrow keys move, Enter takes, Escape closes. */
function PlaceField({ label, end }: { label: string; end: End }) {
  const id = useId();
  const chosen = ends.value[end];
  const places = suggested.value[end];
  const setFound = (places: Place[]) => {
    suggest(end, places);
  };
  const wrong = faults.value.get(STOP_FIELDS[end]) ?? [];
  const [active, setActive] = useState(0);
  const pending = useRef<{ timer: number; request: AbortController } | null>(null);
  const open = places.length > 0;
  const { journey: words } = text.value;

  const take = (place: Place) => {
    write(end, place.name);
    setFound([]);
    setEnd(end, place);
  };
  /** Ask no more: what arrives late would open the list of a field that was left. */
  const forget = () => {
    pending.current?.request.abort();
    window.clearTimeout(pending.current?.timer);
  };
  const type = (now: string) => {
    write(end, now);
    if (ends.value[end]) {
      setEnd(end, null);
      answersAreOld.value = journey.value !== null;
    }
    nextEnd.value = end;
    forget();
    const request = new AbortController();
    const ask = async () => {
      try {
        const places = await placesFor(now, request.signal);
        if (request.signal.aborted) return;
        setFound(places);
        setActive(0);
        if (places.length === 0) unknown.value = { ...unknown.value, [end]: now.trim() };
      } catch (error) {
        reportProblem(error);
      }
    };
    pending.current = { timer: window.setTimeout(() => void ask(), PAUSE_MS), request };
  };
  const press = (event: KeyboardEvent) => {
    const place = places[active];
    if (!open || !place) return;
    if (event.key === "ArrowDown") setActive((active + 1) % places.length);
    else if (event.key === "ArrowUp") setActive((active + places.length - 1) % places.length);
    else if (event.key === ENTER) take(place);
    else if (event.key === ESCAPE) setFound([]);
    else return;
    event.preventDefault();
  };
  return (
    <div class={`place place-${end}`}>
      <label for={id}>{label}</label>
      <input
        id={id}
        role="combobox"
        autocomplete="off"
        spellcheck={false}
        aria-expanded={open}
        aria-controls={`${id}-list`}
        aria-autocomplete="list"
        aria-activedescendant={open ? `${id}-${active}` : undefined}
        aria-invalid={unknown.value[end] !== "" || wrong.length > 0}
        value={chosen?.name ?? typed.value[end]}
        placeholder={map.value?.places ? words.hint : words.hintCoordinates}
        onInput={(event) => type(event.currentTarget.value)}
        onKeyDown={press}
        onFocus={() => {
          nextEnd.value = end;
        }}
        onBlur={() => {
          forget();
          setFound([]);
        }}
      />
      <p class="faults" role="status">
        {unknown.value[end] && words.unknown(unknown.value[end])}
        {unknown.value[end] && open && ` ${words.choose}`}
        {!unknown.value[end] && chosen?.kind && <span class="kind">{kindOf(chosen)}</span>}
      </p>
      <FaultList faults={wrong} />
      <ul id={`${id}-list`} role="listbox" aria-label={label} hidden={!open}>
        {places.map((place, k) => (
          <li
            key={`${place.name}${place.latitude_deg}`}
            id={`${id}-${k}`}
            role="option"
            aria-selected={k === active}
            onMouseDown={(event) => {
              event.preventDefault();
              take(place);
            }}
          >
            {place.name}
            {place.kind && <span class="kind">{` · ${kindOf(place)}`}</span>}
          </li>
        ))}
      </ul>
    </div>
  );
}

/** From and To; a service without a map has none. */
export function JourneyForm() {
  const { journey: words } = text.value;
  const isEmpty = ENDS.some((end) => !ends.value[end] && !typed.value[end].trim());
  return (
    <form
      class="journey"
      onSubmit={(event) => {
        event.preventDefault();
        void plan();
      }}
    >
      <PlaceField label={words.from} end="from" />
      <PlaceField label={words.to} end="to" />
      <button type="submit" class="primary" disabled={isEmpty}>
        {words.plan}
      </button>
    </form>
  );
}
