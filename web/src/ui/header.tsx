import type { Vehicle } from "../api/types";
import { car, choices, chooseModel, chooseVehicle, vehicles } from "../state/car";
import { faults } from "../state/forecast";
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

function Cars({ label, rows }: { label: string; rows: Vehicle[] }) {
  if (rows.length === 0) return null;
  return (
    <optgroup label={label}>
      {rows.map((row) => (
        <option key={row.name} value={row.name}>
          {row.title}
        </option>
      ))}
    </optgroup>
  );
}

function CarSelect() {
  const measured = vehicles.value.filter((row) => row.models.length > 0);
  const others = vehicles.value.filter((row) => row.models.length === 0);
  const wrong = [...(faults.value.get("vehicle") ?? []), ...(faults.value.get("model") ?? [])];
  if (vehicles.value.length === 0) return null;
  return (
    <div class="car">
      <label>
        <span class="unseen">Car</span>
        <select
          value={car.value?.vehicle ?? ""}
          onChange={(event) => chooseVehicle(event.currentTarget.value)}
        >
          <Cars label="Learned from its own trips" rows={measured} />
          <Cars label="By its book values" rows={others} />
        </select>
      </label>
      {choices.value.length > 1 && (
        <label>
          <span class="unseen">Model</span>
          <select value={car.value?.model ?? ""} onChange={(event) => chooseModel(event.currentTarget.value)}>
            {choices.value.map((row) => (
              <option key={row.name} value={row.name}>
                {`${row.name}, ${row.model.trips} trips`}
              </option>
            ))}
          </select>
        </label>
      )}
      <FaultList faults={wrong} />
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
