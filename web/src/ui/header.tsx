import type { Vehicle } from "../api/documents";
import { type System, unitsOf } from "../model/units";
import { car, choices, chooseModel, chooseVehicle, DESCRIBED, vehicles } from "../state/car";
import { faults } from "../state/forecast";
import { openRoad } from "../state/live-drive";
import { ownCars, useCar } from "../state/own-cars";
import { chosenLanguage, language, system, text, type Theme, theme } from "../state/preferences";
import { type Language, LANGUAGES } from "../text";
import { openCarDialog } from "./car-dialog";
import { Choice } from "./choice";
import { FaultList } from "./faults";
import { Icon } from "./icons";
import { openOwnCars } from "./own-cars-dialog";

const THEMES: [Theme, "system" | "sun" | "moon"][] = [
  ["system", "system"],
  ["light", "sun"],
  ["dark", "moon"],
];

const SYSTEMS: System[] = ["metric", "british", "imperial"];

const LANGUAGE_NAMES = Object.entries(LANGUAGES) as [Language, string][];

function ThemeButton() {
  const now = THEMES.findIndex(([name]) => name === theme.value);
  const [name, icon] = THEMES[now] as (typeof THEMES)[number];
  const { header } = text.value;
  const next = THEMES[(now + 1) % THEMES.length] as (typeof THEMES)[number];
  return (
    <button
      type="button"
      class="quiet"
      aria-label={header.changeTheme(header.theme[name])}
      title={header.theme[name]}
      onClick={() => {
        theme.value = next[0];
      }}
    >
      <Icon name={icon} />
    </button>
  );
}

function LanguageChoice() {
  return (
    <Choice
      label={text.value.header.language}
      class="small"
      value={language.value}
      options={LANGUAGE_NAMES.map(
        ([code, name]) =>
          [
            code,
            <abbr key={code} lang={code} title={name}>
              {code.toUpperCase()}
            </abbr>,
          ] as const,
      )}
      onChoose={(code) => {
        chosenLanguage.value = code;
      }}
    />
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

/** Cars by maker, the first word of the title, in alphabetical order. */
function byMaker(rows: Vehicle[]): [string, Vehicle[]][] {
  const groups = new Map<string, Vehicle[]>();
  for (const row of [...rows].sort((a, b) => a.title.localeCompare(b.title))) {
    const [maker = ""] = row.title.split(" ");
    groups.set(maker, [...(groups.get(maker) ?? []), row]);
  }
  return [...groups];
}

/** Fields of a request whose faults belong to the car. */
const CAR_FIELDS = ["vehicle", "vehicle_figures", "consumption_kwh_per_100km", "model"];

/** Value of the option that opens the form; no car has this name. */
const FORM = "form";
/** Value of the option that opens the cars of the service, and the start of the values of these cars. */
const MANAGE = "own";
const OWN = "own:";

function CarSelect() {
  const measured = vehicles.value.filter((row) => row.models.length > 0);
  const others = vehicles.value.filter((row) => row.models.length === 0);
  const wrong = CAR_FIELDS.flatMap((field) => faults.value.get(field) ?? []);
  if (vehicles.value.length === 0) return null;
  const { header } = text.value;
  const chosen = car.value?.own ? OWN + car.value.own : (car.value?.vehicle ?? "");
  return (
    <div class="car">
      <label>
        <span class="unseen">{header.car}</span>
        <select
          value={chosen}
          onChange={(event) => {
            const { value } = event.currentTarget;
            const own = ownCars.value?.find(({ name }) => OWN + name === value);
            if (own) return useCar(own);
            if (value !== FORM && value !== MANAGE) return chooseVehicle(value);
            event.currentTarget.value = chosen;
            if (value === FORM) openCarDialog();
            else openOwnCars(car.value?.own);
          }}
        >
          {car.value?.title && !car.value.own && <option value={DESCRIBED}>{car.value.title}</option>}
          {ownCars.value && (
            <optgroup label={text.value.ownCars.mine}>
              {ownCars.value.map(({ name, label, title }) => (
                <option key={name} value={OWN + name}>
                  {label}: {title}
                </option>
              ))}
              <option value={MANAGE}>{text.value.ownCars.manage}</option>
            </optgroup>
          )}
          <option value={FORM}>{header.missing}</option>
          <Cars label={header.trained} rows={measured} />
          {byMaker(others).map(([maker, rows]) => (
            <Cars key={maker} label={header.publishedOf(maker)} rows={rows} />
          ))}
        </select>
      </label>
      {choices.value.length > 1 && !car.value?.own && (
        <label>
          <span class="unseen">{header.model}</span>
          <select value={car.value?.model ?? ""} onChange={(event) => chooseModel(event.currentTarget.value)}>
            {choices.value.map((row) => (
              <option key={row.name} value={row.name}>
                {header.modelOption(row.name, row.model.trips)}
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
        {/* eslint-disable-next-line page/text -- a name */}
        <h1>tripwatt</h1>
      </div>
      <CarSelect />
      <div class="tools">
        {ownCars.value && (
          <button
            type="button"
            class="quiet"
            aria-label={text.value.live.title}
            title={text.value.live.title}
            onClick={() => void openRoad()}
          >
            <Icon name="wheel" />
          </button>
        )}
        <Choice
          label={text.value.header.units}
          class="small"
          value={system.value}
          options={SYSTEMS.map((name) => {
            const { distance, temperature } = unitsOf(name);
            return [name, `${distance.unit}\u00a0${temperature.unit}`] as const;
          })}
          onChoose={(value) => {
            system.value = value;
          }}
        />
        <LanguageChoice />
        <ThemeButton />
      </div>
    </header>
  );
}
