import { models, vehicles } from "../state/catalogue";
import { faults, model } from "../state/forecast";
import { system, type Theme, theme } from "../state/preferences";
import { Choice } from "./choice";
import { FaultList } from "./faults";
import { Icon } from "./icons";

const THEMES: [Theme, "system" | "sun" | "moon", string][] = [
  ["system", "system", "Theme: as the system"],
  ["light", "sun", "Theme: light"],
  ["dark", "moon", "Theme: dark"],
];

function ThemeButton() {
  const now = THEMES.findIndex(([name]) => name === theme.value);
  const [, icon, text] = THEMES[now] as (typeof THEMES)[number];
  const next = THEMES[(now + 1) % THEMES.length] as (typeof THEMES)[number];
  return (
    <button
      type="button"
      class="quiet"
      aria-label={`${text}. Change it`}
      title={text}
      onClick={() => {
        theme.value = next[0];
      }}
    >
      <Icon name={icon} />
    </button>
  );
}

function CarSelect() {
  const own = models.value.find(({ name }) => name === model.value);
  const withModel = new Map(models.value.map((row) => [row.model.vehicle, row]));
  const without = vehicles.value.filter(({ name }) => !withModel.has(name));
  const ofCar = models.value.filter((row) => row.model.vehicle === own?.model.vehicle);
  const choose = (name: string) => {
    model.value = name;
  };
  return (
    <div class="car">
      <label>
        <span class="unseen">Car</span>
        <select
          value={own?.model.vehicle ?? ""}
          onChange={(event) => choose(withModel.get(event.currentTarget.value)?.name ?? "")}
        >
          <optgroup label="With a model">
            {[...withModel.values()].map((row) => (
              <option key={row.name} value={row.model.vehicle}>
                {row.model.vehicle_title}
              </option>
            ))}
          </optgroup>
          <optgroup label="Known, no model on this service">
            {without.map((car) => (
              <option key={car.name} value={car.name} disabled>
                {car.title}
              </option>
            ))}
          </optgroup>
        </select>
      </label>
      {ofCar.length > 1 && (
        <label>
          <span class="unseen">Model</span>
          <select value={model.value ?? ""} onChange={(event) => choose(event.currentTarget.value)}>
            {ofCar.map((row) => (
              <option key={row.name}>{row.name}</option>
            ))}
          </select>
        </label>
      )}
      <FaultList faults={faults.value.get("model") ?? []} />
    </div>
  );
}

export function Header() {
  return (
    <header class="top">
      <div class="wordmark">
        <svg viewBox="0 0 32 32" aria-hidden="true" focusable="false">
          <path d="M4 22c5-1 6-12 12-12s6 9 12 8" />
          <circle cx="28" cy="18" r="2.6" />
        </svg>
        <h1>tripwatt</h1>
      </div>
      <CarSelect />
      <div class="tools">
        <Choice
          label="Units"
          class="small"
          value={system.value}
          options={[
            ["metric", "km"],
            ["imperial", "mi"],
          ]}
          onChoose={(value) => {
            system.value = value;
          }}
        />
        <ThemeButton />
      </div>
    </header>
  );
}
