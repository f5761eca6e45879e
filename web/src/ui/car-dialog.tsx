import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { describeCar, RequestFailed } from "../api/client";
import type { Fault, Figures } from "../api/types";
import { car, chooseDescribed } from "../state/car";
import { format, text } from "../state/preferences";
import { FaultList } from "./faults";

const open = signal(false);
const faults = signal<Fault[]>([]);

export function openCarDialog(): void {
  open.value = true;
}

/** Fields of numbers: name in the request, key of the label, smallest and largest value, step. */
const NUMBERS = [
  ["mass_kg", "mass", 400, 6000, 1],
  ["usable_battery_kwh", "battery", 4, 300, 0.1],
  ["consumption_kwh_per_100km", "consumption", 6, 60, 0.1],
  ["motor_power_kw", "power", 5, 1500, 1],
] as const;

const BODIES = ["small", "hatchback", "sedan", "estate", "suv", "van", "pickup"] as const;

function figuresFrom(form: HTMLFormElement): Figures {
  const data = new FormData(form);
  const body = BODIES.find((name) => name === data.get("body")) ?? "hatchback";
  const found: Figures = {
    body,
    heat_pump: data.get("heat_pump") !== null,
    procedure: data.get("procedure") === "epa" ? "epa" : "wltp",
  };
  for (const [name] of NUMBERS) {
    const value = Number(data.get(name));
    if (value > 0) found[name] = value;
  }
  return found;
}

/** Apart from the form, whose fields keep what was typed when the faults change. */
function Faults() {
  return <FaultList faults={faults.value} />;
}

/** A form for a car that the service does not have. */
export function CarDialog() {
  const dialog = useRef<HTMLDialogElement>(null);
  const { ownCar: words } = text.value;
  const known = car.value?.figures;
  useEffect(() => {
    if (open.value) dialog.current?.showModal();
    else dialog.current?.close();
  }, [open.value]);
  const submit = async (form: HTMLFormElement) => {
    const figures = figuresFrom(form);
    try {
      const found = await describeCar(JSON.stringify(figures));
      const [middle, low, high] = [
        found.wltp_kwh_per_100km,
        found.wltp_low_kwh_per_100km,
        found.wltp_high_kwh_per_100km,
      ].map((value) => format.value.plain(value, 1));
      chooseDescribed(figures, words.described(middle ?? "", low ?? "", high ?? ""));
      faults.value = [];
      open.value = false;
    } catch (error) {
      if (!(error instanceof RequestFailed)) throw error;
      const { problem } = error;
      faults.value = problem.faults ?? [{ what: problem.title, where: "", got: "", allowed: "", fix: "" }];
    }
  };
  return (
    <dialog
      ref={dialog}
      aria-labelledby="own-car-title"
      onClose={() => {
        open.value = false;
      }}
    >
      <form
        onSubmit={(event) => {
          event.preventDefault();
          void submit(event.currentTarget);
        }}
      >
        <h2 id="own-car-title">{words.title}</h2>
        <p class="note">{words.note}</p>
        {NUMBERS.map(([name, label, min, max, step]) => (
          <label class="field" key={name}>
            <span>{words[label]}</span>
            <input
              name={name}
              type="number"
              inputMode="decimal"
              min={min}
              max={max}
              step={step}
              value={known?.[name] ?? ""}
            />
          </label>
        ))}
        <label class="field">
          <span>{words.procedure}</span>
          <select name="procedure" value={known?.procedure ?? "wltp"}>
            <option value="wltp">{words.procedures.wltp}</option>
            <option value="epa">{words.procedures.epa}</option>
          </select>
        </label>
        <label class="field">
          <span>{words.body}</span>
          <select name="body" value={known?.body ?? "hatchback"}>
            {BODIES.map((body) => (
              <option key={body} value={body}>
                {words.bodies[body]}
              </option>
            ))}
          </select>
        </label>
        <label class="tick">
          <input name="heat_pump" type="checkbox" checked={known?.heat_pump ?? false} />
          {words.heatPump}
        </label>
        <Faults />
        <div class="actions">
          <button
            type="button"
            class="quiet"
            onClick={() => {
              open.value = false;
            }}
          >
            {words.cancel}
          </button>
          <button type="submit" class="primary">
            {words.use}
          </button>
        </div>
      </form>
    </dialog>
  );
}
