import { batch, signal } from "@preact/signals";
import { useId, useRef, useState } from "preact/hooks";
import { findPlaces } from "../api/client";
import type { Place } from "../api/documents";
import { placeCalled } from "../model/places";
import { type End, type Field, readCoordinates } from "../model/road";
import { chooseJourney } from "../state/catalogue";
import { faults, forgetStop, MOST_STOPS, reportProblem, stopField } from "../state/forecast";
import {
  fieldsOfJourney,
  isExample,
  isRound,
  journey,
  map,
  nextEnd,
  placeAt,
  placeOf,
  placesOfJourney,
  setPlace,
  vias,
  wantsFit,
} from "../state/journey";
import { osmKind } from "../state/messages";
import { text } from "../state/preferences";
import { Covers } from "./covers";
import { FaultList } from "./faults";
import { Button, IconButton, Submit, submitting, Tick } from "./parts";

const PAUSE_MS = 120;
// eslint-disable-next-line page/text -- names of keys
const [ENTER, ESCAPE] = ["Enter", "Escape"];

/** Places for a text: coordinates, or names where the service knows them. */
async function placesFor(words: string, signal: AbortSignal): Promise<Place[]> {
  const at = readCoordinates(words);
  if (at) return [placeAt(at.longitude_deg, at.latitude_deg)];
  return words.trim() && map.value?.places ? findPlaces(words, signal) : [];
}

type ByField<T> = Partial<Record<Field, T>>;

/** What is written in the fields, and what of it no place is called. */
const typed = signal<ByField<string>>({});
const unknown = signal<ByField<string>>({});
/** Places to choose from. */
const suggested = signal<ByField<Place[]>>({});

function suggest(end: Field, places: Place[]): void {
  suggested.value = { ...suggested.value, [end]: places };
}

function write(end: Field, words: string): void {
  typed.value = { ...typed.value, [end]: words };
  unknown.value = { ...unknown.value, [end]: "" };
  forgetStop(fieldsOfJourney().indexOf(end));
}

/** Take the place whose whole name is written where none was taken; ask back where there is none, or several. */
async function resolve(end: Field): Promise<void> {
  const words = (typed.value[end] ?? "").trim();
  if (placeOf(end) || !words) return;
  const places = await placesFor(words, new AbortController().signal);
  if ((typed.value[end] ?? "").trim() !== words) return; // written again meanwhile
  const meant = readCoordinates(words) ? places[0] : placeCalled(words, places);
  if (!meant) {
    unknown.value = { ...unknown.value, [end]: words };
    suggest(end, places);
    return;
  }
  batch(() => {
    write(end, meant.name);
    setPlace(end, meant);
  });
}

/** What a place is, in words. */
function kindOf({ kind }: Place): string {
  return kind === "poi" ? text.value.journey.poi : osmKind(kind);
}

async function plan(): Promise<void> {
  try {
    await Promise.all(fieldsOfJourney().map(resolve));
  } catch (error) {
    return reportProblem(error);
  }
  if (!placesOfJourney()) return;
  isExample.value = false;
  wantsFit.value = true;
  journey.value = null;
  chooseJourney();
}

/** A field that suggests places while one types: arrow keys move, Enter takes, Escape closes. */
function PlaceField({ label, end, onRemove }: { label: string; end: Field; onRemove?: () => void }) {
  const id = useId();
  const chosen = placeOf(end);
  const places = suggested.value[end] ?? [];
  const lacks = unknown.value[end] ?? "";
  const setFound = (places: Place[]) => {
    suggest(end, places);
  };
  const wrong = faults.value.get(stopField(fieldsOfJourney().indexOf(end))) ?? [];
  const [active, setActive] = useState(0);
  const pending = useRef<{ timer: number; request: AbortController } | null>(null);
  const open = places.length > 0;
  const { journey: words } = text.value;

  const take = (place: Place) => {
    write(end, place.name);
    setFound([]);
    setPlace(end, place);
  };
  /** Ask no more: what arrives late would open the list of a field that was left. */
  const forget = () => {
    pending.current?.request.abort();
    window.clearTimeout(pending.current?.timer);
  };
  const type = (now: string) => {
    write(end, now);
    if (placeOf(end)) setPlace(end, null);
    if (isEnd(end)) nextEnd.value = end;
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
    <div class={`place ${onRemove ? "place-via" : `place-${end}`}`}>
      <label for={id}>{label}</label>
      {onRemove && <IconButton icon="close" label={words.removeVia(label)} onClick={onRemove} />}
      <input
        id={id}
        role="combobox"
        autocomplete="off"
        spellcheck={false}
        aria-expanded={open}
        aria-controls={`${id}-list`}
        aria-autocomplete="list"
        aria-activedescendant={open ? `${id}-${active}` : undefined}
        aria-invalid={lacks !== "" || wrong.length > 0}
        value={chosen?.name ?? typed.value[end] ?? ""}
        placeholder={map.value?.places ? words.hint : words.hintCoordinates}
        onInput={(event) => type(event.currentTarget.value)}
        onKeyDown={press}
        onFocus={(event) => {
          // what is typed replaces the place that is there
          if (chosen) event.currentTarget.select();
          if (isEnd(end)) nextEnd.value = end;
        }}
        onBlur={() => {
          forget();
          setFound([]);
        }}
      />
      <p class="faults" role="status">
        {lacks && words.unknown(lacks)}
        {lacks && (open ? ` ${words.choose}` : <Covers />)}
        {!lacks && chosen?.kind && <span class="kind">{kindOf(chosen)}</span>}
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
            {place.also_called && <span class="kind">{` — ${words.alsoCalled(place.also_called)}`}</span>}
            {place.context && <span class="kind">{`, ${place.context}`}</span>}
            {place.kind && <span class="kind">{` · ${kindOf(place)}`}</span>}
          </li>
        ))}
      </ul>
    </div>
  );
}

function isEnd(field: Field): field is End {
  return field === "from" || field === "to";
}

/** Take a place on the way out, with what is written in the fields after it. */
function removeVia(at: number): void {
  const without = <T,>(all: ByField<T>): ByField<T> => {
    const next: ByField<T> = {};
    for (const [name, value] of Object.entries(all) as [Field, T][]) {
      const k = isEnd(name) ? -1 : Number(name.slice(3));
      const moved: Field = k > at ? `via${k - 1}` : name;
      if (k !== at) next[moved] = value;
    }
    return next;
  };
  batch(() => {
    typed.value = without(typed.value);
    unknown.value = without(unknown.value);
    suggested.value = {};
    vias.value = vias.value.filter((_, k) => k !== at);
  });
}

/** From and To, with places on the way and the way back; a service without a map has none. */
export function JourneyForm() {
  const { journey: words } = text.value;
  const isEmpty = fieldsOfJourney().some((field) => !placeOf(field) && !typed.value[field]?.trim());
  return (
    <form class="journey" onSubmit={submitting(() => void plan())}>
      <PlaceField label={words.from} end="from" />
      {vias.value.map((_, k) => (
        <PlaceField key={k} label={words.via(k + 1)} end={`via${k}`} onRemove={() => removeVia(k)} />
      ))}
      <PlaceField label={words.to} end="to" />
      <div class="inline">
        <Tick
          label={words.andBack}
          checked={isRound.value}
          onChange={(checked) => {
            isRound.value = checked;
            void plan();
          }}
        />
        {vias.value.length < MOST_STOPS - 2 && (
          <Button
            class="link"
            onClick={() => {
              vias.value = [...vias.value, null];
            }}
            label={words.addVia}
          />
        )}
      </div>
      <Submit label={words.plan} disabled={isEmpty} />
    </form>
  );
}
