/** One field for the car: search of the library, the driver's own cars, and the way to describe one. */

import { signal } from "@preact/signals";
import { useId, useState } from "preact/hooks";
import { findVehicles } from "../api/client";
import { Latest } from "../api/latest";
import type { Vehicle } from "../api/documents";
import { beginning } from "../model/cars";
import { car, chooseVehicle, vehicle, vehicles } from "../state/car";
import { faults } from "../state/forecast";
import { labelOf, openOwnCars, ownCars, useCar } from "../state/own-cars";
import { text } from "../state/preferences";
import { openCarDialog } from "./car-dialog";
import { FaultList } from "./faults";

const MIN_INTERVAL_MS = 120;
// eslint-disable-next-line page/text -- names of keys
const [ENTER, ESCAPE] = ["Enter", "Escape"];

/** Fields of a request whose faults belong to the car. */
const CAR_FIELDS = ["car", "consumption_kwh_per_100km", "model"];

/** What the library has for the words; null while nothing is typed. */
const matches = signal<Vehicle[] | null>(null);

const search = new Latest<string>(async (words, abort) => {
  try {
    const found = await findVehicles(words, abort);
    matches.value = found.length === 0 ? beginning(words, vehicles.value) : found;
  } catch {
    matches.value = beginning(words, vehicles.value);
  }
}, MIN_INTERVAL_MS);

interface Option {
  key: string;
  name: string;
  detail: string;
  take: () => void;
}

/** The driver's own cars that the words name, cars of the library, and what else there is to do. */
function optionsFor(words: string): Option[] {
  const { header, ownCars: own } = text.value;
  const typed = words.toLowerCase();
  const mine = (ownCars.value ?? [])
    .filter(({ label, title }) => `${label} ${title}`.toLowerCase().includes(typed))
    .map((row) => ({
      key: `own:${row.name}`,
      name: row.label,
      detail: `${row.title} · ${own.title}`,
      take: () => useCar(row),
    }));
  const rows = matches.value ?? [...vehicles.value].sort((a, b) => b.models.length - a.models.length);
  const library = rows.map((row) => ({
    key: row.name,
    name: row.title,
    detail: row.models.length > 0 ? header.measured : "",
    take: () => chooseVehicle(row.name),
  }));
  const form = { key: "form", name: header.missing, detail: "", take: openCarDialog };
  const open = { key: "manage", name: own.manage, detail: "", take: () => openOwnCars(car.value?.own) };
  const manage = ownCars.value ? [open] : [];
  // beside the own cars while nothing is typed; what is typed is first a car
  return words ? [...mine, ...library, ...manage, form] : [...mine, ...manage, ...library, form];
}

function titleOfCar(): string {
  const { own, title } = car.value ?? {};
  if (own) return `${labelOf(own)}: ${title ?? ""}`;
  return title || (vehicle.value?.title ?? "");
}

/** A field with a list: arrow keys move, Enter takes, Escape closes. */
export function CarField() {
  const id = useId();
  const [typed, setTyped] = useState<string | null>(null);
  const [active, setActive] = useState<string | null>(null);
  const wrong = CAR_FIELDS.flatMap((field) => faults.value.get(field) ?? []);
  if (vehicles.value.length === 0) return null;
  const isOpen = typed !== null;
  const options = isOpen ? optionsFor(typed) : [];
  // by its key: what was moved to stays active while the answer to the words comes in
  const now = Math.max(
    0,
    options.findIndex(({ key }) => key === active),
  );
  const close = () => setTyped(null);
  const take = (option: Option | undefined) => {
    close();
    option?.take();
  };
  const move = (to: number) => {
    setActive(options[to]?.key ?? null);
    document.getElementById(`${id}-${to}`)?.scrollIntoView({ block: "nearest" });
  };
  const open = (words: string) => {
    setTyped(words);
    setActive(null);
    if (!words) matches.value = null;
    search.submit(words.trim() || null);
  };
  const press = (event: KeyboardEvent) => {
    if (!isOpen && event.key === "ArrowDown") open("");
    else if (!isOpen) return;
    else if (event.key === "ArrowDown") move((now + 1) % options.length);
    else if (event.key === "ArrowUp") move((now + options.length - 1) % options.length);
    else if (event.key === ENTER) take(options[now]);
    else if (event.key === ESCAPE) close();
    else return;
    event.preventDefault();
  };
  const { header } = text.value;
  return (
    <div class="car place">
      <label for={id} class="unseen">
        {header.car}
      </label>
      <input
        id={id}
        role="combobox"
        autocomplete="off"
        spellcheck={false}
        maxLength={100}
        aria-expanded={isOpen}
        aria-controls={`${id}-list`}
        aria-autocomplete="list"
        aria-activedescendant={isOpen ? `${id}-${now}` : undefined}
        placeholder={header.search}
        value={typed ?? titleOfCar()}
        onFocus={(event) => event.currentTarget.select()}
        onClick={() => !isOpen && open("")}
        onInput={(event) => open(event.currentTarget.value)}
        onKeyDown={press}
        onBlur={close}
      />
      <ul id={`${id}-list`} role="listbox" aria-label={header.car} hidden={!isOpen}>
        {options.map((option, k) => (
          <li
            key={option.key}
            id={`${id}-${k}`}
            role="option"
            aria-selected={k === now}
            onMouseDown={(event) => {
              event.preventDefault();
              take(option);
            }}
          >
            {option.name}
            {option.detail && <span class="kind">{` · ${option.detail}`}</span>}
          </li>
        ))}
      </ul>
      <FaultList faults={wrong} />
    </div>
  );
}
