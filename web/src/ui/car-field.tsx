/** One field for the car: search of the library, the driver's own cars, and the way to describe one. */

import { signal } from "@preact/signals";
import { useId, useState } from "preact/hooks";
import { findVehicles } from "../api/client";
import { Latest } from "../api/latest";
import type { Vehicle } from "../api/documents";
import { withBeginning } from "../model/cars";
import { car, chooseOwn, chooseVehicle, vehicle, vehicles } from "../state/car";
import { faults } from "../state/forecast";
import { labelOf, openOwnCars, ownCars } from "../state/own-cars";
import { text } from "../state/preferences";
import { openCarDialog } from "./car-dialog";
import { Combobox, type Option } from "./combobox";
import { FaultList } from "./faults";

const MIN_INTERVAL_MS = 120;

/** Fields of a request whose faults belong to the car. */
const CAR_FIELDS = ["car", "consumption_kwh_per_100km", "model"];

/** What the library has for the words; null while nothing is typed. */
const matches = signal<Vehicle[] | null>(null);

const search = new Latest<string>(async (words, abort) => {
  const found = await findVehicles(words, abort).catch(() => []);
  if (!abort.aborted) matches.value = withBeginning(words, found, vehicles.value);
}, MIN_INTERVAL_MS);

/** The driver's own cars that the words name, cars of the library, and what else there is to do. */
function optionsFor(words: string): Option[] {
  const { header, ownCars: own } = text.value;
  const typed = words.toLowerCase();
  const mine = (ownCars.value ?? [])
    .filter(({ label, title }) => `${label} ${title}`.toLowerCase().includes(typed))
    .map((row) => ({
      key: `own:${row.name}`,
      name: row.label,
      detail: ` · ${row.title} · ${own.title}`,
      take: () => chooseOwn(row),
    }));
  const rows = matches.value ?? [...vehicles.value].sort((a, b) => b.models.length - a.models.length);
  const library = rows.map((row) => ({
    key: row.name,
    name: row.title,
    detail: row.models.length > 0 ? ` · ${header.measured}` : "",
    take: () => chooseVehicle(row.name),
  }));
  const form = { key: "form", name: header.missing, detail: "", take: openCarDialog };
  const open = { key: "manage", name: own.manage, detail: "", take: () => openOwnCars() };
  const manage = ownCars.value ? [open] : [];
  // beside the own cars while nothing is typed; what is typed is first a car
  return words ? [...mine, ...library, ...manage, form] : [...mine, ...manage, ...library, form];
}

function titleOfCar(): string {
  const { own, title } = car.value ?? {};
  if (own) return `${labelOf(own)}: ${title ?? ""}`;
  return title || (vehicle.value?.title ?? "");
}

export function CarField() {
  const id = useId();
  const [typed, setTyped] = useState<string | null>(null);
  const wrong = CAR_FIELDS.flatMap((field) => faults.value.get(field) ?? []);
  if (vehicles.value.length === 0) return null;
  const open = (words: string) => {
    setTyped(words);
    // those of the page at once: the service may be busy with a journey
    matches.value = words.trim() ? withBeginning(words, [], vehicles.value) : null;
    search.submit(words.trim() || null);
  };
  const { header } = text.value;
  return (
    <div class="car place">
      <label for={id} class="unseen">
        {header.car}
      </label>
      <Combobox
        id={id}
        label={header.car}
        value={typed ?? titleOfCar()}
        placeholder={header.search}
        maxLength={100}
        isWrong={wrong.length > 0}
        options={typed === null ? [] : optionsFor(typed)}
        onType={open}
        onOpen={() => open("")}
        onFocus={(input) => input.select()}
        onClose={() => setTyped(null)}
      />
      <FaultList faults={wrong} />
    </div>
  );
}
