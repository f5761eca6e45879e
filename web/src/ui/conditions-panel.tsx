import type { ClimateMode, Terrain } from "../api/documents";
import { hasMotorway, MOTORWAY_M_S } from "../model/links";
import { change, conditions, type BeforeDeparture, GARAGE_DEGC, resetTo } from "../state/conditions";
import { departure, faults, mode, other } from "../state/forecast";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";
import { Slider } from "./slider";

const USUAL_MOTORWAY_M_S = 130 / 3.6;

/** Sliders from top to bottom: setting, key of the label, fields of the request. */
const SLIDERS = [
  ["ambientDegc", "outside", ["ambient_temperature_degc"]],
  ["setpointDegc", "cabin", ["cabin_setpoint_degc"]],
  ["soc", "soc", ["soc", "displayed_soc"]],
  ["payloadKg", "payload", ["payload_mass_kg"]],
  ["reserve", "reserve", ["reserve"]],
] as const;

const BEFORE_DEPARTURE: BeforeDeparture[] = ["parked", "garage", "logged", "unknown"];

const CLIMATE_MODES: ClimateMode[] = ["auto", "heat", "cool", "off"];

function ClimateSelect() {
  const { conditions: words } = text.value;
  return (
    <label class="field">
      <span>{words.climate}</span>
      <select
        value={conditions.value.climate}
        onChange={(event) => change({ climate: event.currentTarget.value as ClimateMode })}
      >
        {CLIMATE_MODES.map((mode) => (
          <option key={mode} value={mode}>
            {words.climateModes[mode]}
          </option>
        ))}
      </select>
    </label>
  );
}

const TERRAINS: Terrain[] = ["unknown", "flat", "hilly", "mountains"];

/** What is known of the country; only where the heights of the road are not. */
function TerrainSelect() {
  const { conditions: words } = text.value;
  if (!departure.value?.climb) return null;
  return (
    <label class="field">
      <span>{words.terrain}</span>
      <select
        value={conditions.value.terrain}
        onChange={(event) => change({ terrain: event.currentTarget.value as Terrain })}
      >
        {TERRAINS.map((terrain) => (
          <option key={terrain} value={terrain}>
            {words.terrains[terrain]}
          </option>
        ))}
      </select>
    </label>
  );
}

function beforeDepartureText(choice: BeforeDeparture): string {
  const { conditions: words } = text.value;
  const shown = (degc: number) => format.value.shown(degc, units.value.temperature);
  if (choice === "parked") return words.parked(shown(conditions.value.ambientDegc));
  return choice === "garage" ? words.garage(shown(GARAGE_DEGC)) : words[choice];
}

function BeforeDepartureSelect() {
  const known = Object.keys(trip.value?.logged ?? {}).length > 0;
  return (
    <label class="field">
      <span>{text.value.conditions.before}</span>
      <select
        value={conditions.value.beforeDeparture}
        onChange={(event) => change({ beforeDeparture: event.currentTarget.value as BeforeDeparture })}
      >
        {BEFORE_DEPARTURE.filter((choice) => known || choice !== "logged").map((choice) => (
          <option key={choice} value={choice}>
            {beforeDepartureText(choice)}
          </option>
        ))}
      </select>
    </label>
  );
}

function Motorway() {
  const links = trip.value?.links;
  if (!links || !hasMotorway(links)) return null;
  const now = conditions.value.motorwayMS;
  const { speed } = units.value;
  const { conditions: words } = text.value;
  return (
    <div class="field">
      <label class="tick">
        <input
          type="checkbox"
          checked={now !== null}
          onChange={(event) =>
            change({ motorwayMS: event.currentTarget.checked ? USUAL_MOTORWAY_M_S : null })
          }
        />
        {words.changeMotorway(format.value.shown(MOTORWAY_M_S, speed))}
      </label>
      {now !== null && (
        <Slider
          setting="motorwayMS"
          label={words.motorway}
          value={now}
          onChange={(motorwayMS) => change({ motorwayMS })}
        />
      )}
    </div>
  );
}

export function ConditionsPanel() {
  const now = conditions.value;
  const { conditions: words, settings } = text.value;
  const start = trip.value?.start;
  const changed = start && JSON.stringify({ ...start, reserve: now.reserve }) !== JSON.stringify(now);
  return (
    <section class="panel conditions" aria-labelledby="conditions-title">
      <div class="heading">
        <h2 id="conditions-title">{words.title}</h2>
        {changed && (
          <button type="button" class="link" onClick={() => resetTo(start)}>
            {words.reset}
          </button>
        )}
      </div>
      {mode.value === "compare" && (
        <p class="note">{words.compared(settings[other.value.setting].inSentence)}</p>
      )}
      {SLIDERS.map(([setting, label, fields]) => (
        <Slider
          key={setting}
          setting={setting}
          label={words[label]}
          value={now[setting]}
          faults={fields.flatMap((field) => faults.value.get(field) ?? [])}
          onChange={(si) => change({ [setting]: si })}
        />
      ))}
      <Motorway />
      <TerrainSelect />
      <ClimateSelect />
      <BeforeDepartureSelect />
    </section>
  );
}
