import { batch, signal } from "@preact/signals";
import { useId, useMemo, useState } from "preact/hooks";
import { findPlaces } from "../api/client";
import type { Place } from "../api/documents";
import { Latest } from "../api/latest";
import { placeCalled } from "../model/places";
import { type End, type Field, readCoordinates } from "../model/road";
import { HOURS } from "../model/units";
import { chooseJourney } from "../state/catalogue";
import { faults, forgetStop, MOST_STOPS, reportProblem, stopField } from "../state/forecast";
import { canLocate, lacksPosition, startHere } from "../state/here";
import {
  fieldsOfJourney,
  isOfForm,
  isExample,
  journey,
  map,
  nextEnd,
  pauseS,
  placeAt,
  placeOf,
  placesOfJourney,
  setPlace,
  vias,
  wantsFit,
} from "../state/journey";
import { osmKind } from "../state/messages";
import { trip } from "../state/trip";
import { text } from "../state/preferences";
import { Combobox, type Option } from "./combobox";
import { Covers } from "./covers";
import { FaultList } from "./faults";
import { NumberField } from "./number-field";
import { Button, IconButton, Submit, submitting, Tick } from "./parts";

const MIN_INTERVAL_MS = 120;

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

/** Whether the ways to choose a trip are shown beside the answer. */
export const isFormOpen = signal(false);

/** Plan the journey as soon as its places are known; `folds` closes the form then. */
async function plan(folds: boolean): Promise<void> {
  try {
    await Promise.all(fieldsOfJourney().map(resolve));
  } catch (error) {
    return reportProblem(error);
  }
  if (!placesOfJourney()) return;
  isExample.value = false;
  wantsFit.value = true;
  journey.value = null;
  if (folds) isFormOpen.value = false;
  chooseJourney();
}

/** Suggests places for what is written in a field. */
function searchFor(end: Field): Latest<string> {
  const search = new Latest<string>(async (words, signal) => {
    try {
      const places = await placesFor(words, signal);
      if (signal.aborted || search.isWaiting) return;
      suggest(end, places);
      if (places.length === 0) unknown.value = { ...unknown.value, [end]: words.trim() };
    } catch (error) {
      reportProblem(error);
    }
  }, MIN_INTERVAL_MS);
  return search;
}

function optionOf(end: Field, place: Place): Option {
  const { also_called: other, context } = place;
  const also = other && ` — ${text.value.journey.alsoCalled(other)}`;
  const isTold = place.name.endsWith(context);
  return {
    key: `${place.name}${place.latitude_deg}`,
    name: place.name,
    detail: `${also}${isTold ? "" : `, ${context}`}${place.kind && ` · ${kindOf(place)}`}`,
    take: () => {
      write(end, place.name);
      setPlace(end, place);
    },
  };
}

/** A field that suggests places while one types. */
function PlaceField({ label, end, onRemove }: { label: string; end: Field; onRemove?: () => void }) {
  const id = useId();
  const search = useMemo(() => searchFor(end), [end]);
  const chosen = placeOf(end);
  const [isOpened, setOpened] = useState(false);
  const mayLocate = end === "from" && canLocate;
  const found = (suggested.value[end] ?? []).map((place) => optionOf(end, place));
  const { fromHere, lacks: reasons, here } = text.value.position;
  const device = { key: "here", name: fromHere, detail: "", take: () => startHere(here) };
  const options = isOpened && found.length === 0 ? [device] : found;
  const lacks = unknown.value[end] ?? "";
  const wrong = faults.value.get(stopField(fieldsOfJourney().indexOf(end))) ?? [];
  const { journey: words } = text.value;
  return (
    <div class={`place ${onRemove ? "place-via" : `place-${end}`}`}>
      <label for={id}>{label}</label>
      {onRemove && <IconButton icon="close" label={words.removeVia(label)} onClick={onRemove} />}
      <Combobox
        id={id}
        label={label}
        value={chosen?.name ?? typed.value[end] ?? ""}
        placeholder={map.value?.places ? words.hint : words.hintCoordinates}
        maxLength={200}
        isWrong={lacks !== "" || wrong.length > 0}
        options={options}
        onType={(now) => {
          setOpened(now === "" && mayLocate); // who clears the field may still take his position
          lacksPosition.value = null;
          write(end, now);
          if (placeOf(end)) setPlace(end, null);
          if (isEnd(end)) nextEnd.value = end;
          search.submit(now);
        }}
        {...(mayLocate && { onOpen: () => setOpened(true) })}
        onFocus={(input) => {
          // what is typed replaces the place that is there
          if (chosen) input.select();
          if (isEnd(end)) nextEnd.value = end;
        }}
        onClose={() => {
          search.cancel(); // what arrives late would open the list of a field that was left
          suggest(end, []);
          setOpened(false);
        }}
      />
      <p class="faults" role="status">
        {end === "from" && lacksPosition.value && reasons[lacksPosition.value]}
        {lacks && words.unknown(lacks)}
        {lacks && (options.length > 0 ? ` ${words.choose}` : <Covers />)}
        {!lacks && chosen?.kind && <span class="kind">{kindOf(chosen)}</span>}
      </p>
      <FaultList faults={wrong} />
    </div>
  );
}

function isEnd(field: Field): field is End {
  return field === "from" || field === "to";
}

/** Take a place on the way out, with what is written in the fields after it. */
function removeVia(at: number): void {
  const kept = fieldsOfJourney().filter((name) => name !== `via${at}`);
  batch(() => {
    vias.value = vias.value.filter((_, k) => k !== at);
    const moved = <T,>(all: ByField<T>): ByField<T> =>
      Object.fromEntries(fieldsOfJourney().map((name, k) => [name, all[kept[k] as Field]]));
    typed.value = moved(typed.value);
    unknown.value = moved(unknown.value);
    suggested.value = {};
  });
}

/** Drive back after a pause [s], or null to stay; a journey that is shown is planned again. */
function setPause(nextS: number | null): void {
  const isShown = trip.value?.stops != null && isOfForm.value;
  pauseS.value = nextS;
  if (isShown) void plan(false);
}

/** From and To, with places on the way and the way back; a service without a map has none. */
export function JourneyForm() {
  const { journey: words } = text.value;
  const isEmpty = fieldsOfJourney().some((field) => !placeOf(field) && !typed.value[field]?.trim());
  return (
    <form class="journey" onSubmit={submitting(() => void plan(true))}>
      <PlaceField label={words.from} end="from" />
      {vias.value.map((_, k) => (
        <PlaceField key={k} label={words.via(k + 1)} end={`via${k}`} onRemove={() => removeVia(k)} />
      ))}
      <PlaceField label={words.to} end="to" />
      <div class="inline">
        <Tick
          label={words.andBack}
          checked={pauseS.value !== null}
          onChange={(checked) => setPause(checked ? 0 : null)}
        />
        {vias.value.length < MOST_STOPS - 2 && (
          <Button class="link" onClick={() => (vias.value = [...vias.value, null])} label={words.addVia} />
        )}
        {pauseS.value !== null && (
          <NumberField
            label={words.pause}
            value={pauseS.value || null}
            quantity={HOURS}
            digits={1}
            onChange={(next) => setPause(Math.max(next ?? 0, 0))}
          />
        )}
      </div>
      <Submit label={words.plan} disabled={isEmpty} />
    </form>
  );
}
