import { useId, useRef, useState } from "preact/hooks";
import { findPlaces } from "../api/client";
import type { Place } from "../api/types";
import { chooseJourney } from "../state/catalogue";
import { reportProblem } from "../state/forecast";
import { map } from "../state/journey";
import { text } from "../state/preferences";

const PAUSE_MS = 120;
// eslint-disable-next-line page/text -- names of keys
const [ENTER, ESCAPE] = ["Enter", "Escape"];

interface FieldProps {
  label: string;
  chosen: Place | null;
  onChoose: (place: Place | null) => void;
}

/** A field that suggests places while one types: arrow keys move, Enter takes, Escape closes. */
function PlaceField({ label, chosen, onChoose }: FieldProps) {
  const id = useId();
  const [typed, setTyped] = useState("");
  const [found, setFound] = useState<Place[]>([]);
  const [active, setActive] = useState(0);
  const pending = useRef<{ timer: number; request: AbortController } | null>(null);
  const open = found.length > 0;

  const take = (place: Place) => {
    setTyped(place.name);
    setFound([]);
    onChoose(place);
  };
  const type = (words: string) => {
    setTyped(words);
    onChoose(null);
    pending.current?.request.abort();
    window.clearTimeout(pending.current?.timer);
    const request = new AbortController();
    const ask = async () => {
      try {
        const places = words.trim() ? await findPlaces(words, request.signal) : [];
        setFound(places);
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
    <div class="place">
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
        placeholder={text.value.journey.hint}
        onInput={(event) => type(event.currentTarget.value)}
        onKeyDown={press}
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
  const [from, setFrom] = useState<Place | null>(null);
  const [to, setTo] = useState<Place | null>(null);
  const words = text.value.journey;
  const both = from !== null && to !== null;
  return (
    <form
      class="journey"
      onSubmit={(event) => {
        event.preventDefault();
        if (from && to) void chooseJourney(from, to);
      }}
    >
      <PlaceField label={words.from} chosen={from} onChoose={setFrom} />
      <PlaceField label={words.to} chosen={to} onChoose={setTo} />
      <button type="submit" class="primary" disabled={!both}>
        {words.plan}
      </button>
      <p class="note">{map.value?.attribution}</p>
    </form>
  );
}
