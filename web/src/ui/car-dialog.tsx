import { signal } from "@preact/signals";
import { describeCar } from "../api/client";
import type { Fault, Figures } from "../api/documents";
import { car, chooseDescribed } from "../state/car";
import { ENERGY, POWER } from "../model/units";
import { faultsFrom } from "../state/own-cars";
import { format, text, units } from "../state/preferences";
import { FaultList } from "./faults";
import { typedText } from "./number-field";
import { Button, put, Submit, submitting, useModal } from "./parts";
import { Select } from "./select";

const open = signal(false);
const faults = signal<Fault[]>([]);

export const openCarDialog = put(open, true);

/** Consumption in the request is in kWh/100 km, in the page in Wh/m. */
const WH_M = 0.01;

/** By their names in the request; `scale` is what one unit of the request is in SI. */
const NUMBERS = [
  { name: "mass_kg", label: "mass", quantity: () => units.value.mass, scale: 1, digits: 0 },
  { name: "usable_battery_kwh", label: "battery", quantity: () => ENERGY, scale: 1000, digits: 1 },
  {
    name: "consumption_kwh_per_100km",
    label: "consumption",
    quantity: () => units.value.consumption,
    scale: WH_M,
    digits: 2,
  },
  { name: "motor_power_kw", label: "power", quantity: () => POWER, scale: 1000, digits: 0 },
] as const;

const BODIES = ["small", "hatchback", "sedan", "estate", "suv", "van", "pickup", "quadricycle"] as const;

function figuresFrom(form: HTMLFormElement): Figures {
  const data = new FormData(form);
  const body = BODIES.find((name) => name === data.get("body")) ?? "hatchback";
  const figures: Figures = {
    body,
    heat_pump: data.get("heat_pump") !== null,
    procedure: data.get("procedure") === "epa" ? "epa" : "wltp",
  };
  for (const { name, quantity, scale } of NUMBERS) {
    const value = Number(data.get(name));
    if (value > 0) figures[name] = Number((quantity().to(value) / scale).toPrecision(9));
  }
  return figures;
}

const close = put(open, false);

/** Apart from the form, whose fields keep what was typed when the faults change. */
function Faults() {
  return <FaultList faults={faults.value} />;
}

/** A form for a car that the service does not have. */
export function CarDialog() {
  const dialog = useModal(open.value);
  const { ownCar: words } = text.value;
  const known = car.value?.figures;
  const submit = async (form: HTMLFormElement) => {
    const figures = figuresFrom(form);
    try {
      const described = await describeCar(figures);
      const { consumption } = units.value;
      const shown = (value: number) => format.value.plain(consumption.from(value * WH_M), 1);
      const ends = [described.wltp_low_kwh_per_100km, described.wltp_high_kwh_per_100km];
      const [low = 0, high = 0] = ends.sort((a, b) => consumption.from(a) - consumption.from(b));
      const { wltp_kwh_per_100km: middle } = described;
      chooseDescribed(figures, words.described(shown(middle), shown(low), shown(high), consumption.unit));
      faults.value = [];
      close();
    } catch (error) {
      faults.value = faultsFrom(error);
    }
  };
  return (
    <dialog ref={dialog} aria-labelledby="own-car-title" onClose={close}>
      <form onSubmit={submitting((form) => void submit(form))}>
        <h2 id="own-car-title">{words.title}</h2>
        <p class="note">{words.note}</p>
        {NUMBERS.map(({ name, label, quantity, scale, digits }) => {
          const value = known?.[name];
          return (
            <label class="field" key={name}>
              <span>{words[label](quantity().unit)}</span>
              <input
                name={name}
                type="number"
                inputMode="decimal"
                min={0}
                step="any"
                value={typedText(value == null ? null : value * scale, quantity(), digits)}
              />
            </label>
          );
        })}
        <Select
          name="procedure"
          label={words.procedure}
          value={known?.procedure ?? "wltp"}
          options={(["wltp", "epa"] as const).map((name) => [name, words.procedures[name]])}
        />
        <Select
          name="body"
          label={words.body}
          value={known?.body ?? "hatchback"}
          options={BODIES.map((body) => [body, words.bodies[body]])}
        />
        <label class="tick">
          <input name="heat_pump" type="checkbox" checked={known?.heat_pump ?? false} />
          {words.heatPump}
        </label>
        <Faults />
        <div class="actions">
          <Button class="quiet" onClick={close} label={text.value.cancel} />
          <Submit label={words.use} />
        </div>
      </form>
    </dialog>
  );
}
