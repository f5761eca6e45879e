import { useId, useRef, useState } from "preact/hooks";
import { findPlaces } from "../api/client";
import type { Place } from "../api/types";
import { readCoordinates } from "../model/road";
import { chooseJourney } from "../state/catalogue";
import { reportProblem } from "../state/forecast";
import { type End, ends, journey, map, nextEnd, placeAt, setEnd, wantsFit } from "../state/journey";
import { text } from "../state/preferences";

const PAUSE_MS = 120;
// eslint-disable-next-line page/text -- names of keys
const [ENTER, ESCAPE] = ["Enter", "Escape"];

/** Places for a text: coordinates, or names where the service knows them. */
async function placesFor(words: string, signal: AbortSignal): Promise<Place[]> {
  const at = readCoordinates(words);
  if (at) return [placeAt(at.longitude_deg, at.latitude_deg)];
  return words.trim() && map.value?.places ? findPlaces(words, signal) : [];
}

/** A field that suggests places while one types: arrow keys move, Enter takes, Escape closes. */
function PlaceField({ label, end }: { label: string; end: End }) {
  const id = useId();
  const chosen = ends.value[end];
  const [typed, setTyped] = useState("");
  const [found, setFound] = useState<Place[]>([]);
  const [active, setActive] = useState(0);
  const pending = useRef<{ timer: number; request: AbortController } | null>(null);
  const open = found.length > 0;
  const { journey: words } = text.value;

  const take = (place: Place) => {
    setTyped(place.name);
    setFound([]);
    setEnd(end, place);
  };
  const type = (now: string) => {
    setTyped(now);
    if (ends.value[end]) setEnd(end, null);
    nextEnd.value = end;
    pending.current?.request.abort();
    window.clearTimeout(pending.current?.timer);
    const request = new AbortController();
    const ask = async () => {
      try {
        setFound(await placesFor(now, request.signal));
        setActive(0);
      } catch (error) {
        reportProblem(error);
      }
    };
    pending.current = { timer: window.setTimeout(() => void ask(), PAUSE_MS), request };
  };
  const press = (event: KeyboardEvent) => {
    const place = found[active];
    if (!open || !place) return;
    if (event.key === "ArrowDown") setActive((active + 1) % found.length);
    else if (event.key === "ArrowUp") setActive((active + found.length - 1) % found.length);
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
        value={chosen?.name ?? typed}
        placeholder={map.value?.places ? words.hint : words.hintCoordinates}
        onInput={(event) => type(event.currentTarget.value)}
        onKeyDown={press}
        onFocus={() => {
          nextEnd.value = end;
        }}
        onBlur={() => setFound([])}
      />
      <ul id={`${id}-list`} role="listbox" aria-label={label} hidden={!open}>
        {found.map((place, k) => (
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
          </li>
        ))}
      </ul>
    </div>
  );
}

/** From and To; a service without a map has none. */
export function JourneyForm() {
  const { from, to } = ends.value;
  const { journey: words } = text.value;
  return (
    <form
      class="journey"
      onSubmit={(event) => {
        event.preventDefault();
        wantsFit.value = true;
        journey.value = null;
        chooseJourney();
      }}
    >
      <PlaceField label={words.from} end="from" />
      <PlaceField label={words.to} end="to" />
      <button type="submit" class="primary" disabled={!from || !to}>
        {words.plan}
      </button>
    </form>
  );
}
