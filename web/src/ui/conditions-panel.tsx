import { hasMotorway, MOTORWAY_M_S } from "../model/links";
import { PERCENT, shown } from "../model/units";
import { change, conditions, type Door, resetTo } from "../state/conditions";
import { faults, mode, other } from "../state/forecast";
import { units } from "../state/preferences";
import { trip } from "../state/trip";
import { Slider } from "./slider";

const LIMITS = {
  ambient: [-25, 45],
  setpoint: [15, 28],
  soc: [0.05, 1],
  payload: [0, 500],
  reserve: [0, 0.5],
  motorway: [80 / 3.6, 150 / 3.6],
} satisfies Record<string, [number, number]>;

const USUAL_MOTORWAY_M_S = 130 / 3.6;

const DOORS: [Door, string][] = [
  ["parked", "Parked outside: as cold or warm as the air"],
  ["garage", "In a garage or preheated: 15 °C"],
  ["logged", "As the log says"],
  ["unknown", "Not known"],
];

function DoorSelect() {
  const known = Object.keys(trip.value?.logged ?? {}).length > 0;
  return (
    <label class="field">
      <span>Before departure</span>
      <select
        value={conditions.value.door}
        onChange={(event) => change({ door: event.currentTarget.value as Door })}
      >
        {DOORS.filter(([door]) => known || door !== "logged").map(([door, text]) => (
          <option key={door} value={door}>
            {text}
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
        Another speed where {shown(MOTORWAY_M_S, speed)} or more is planned
      </label>
      {now !== null && (
        <Slider
          label="Motorway speed"
          value={now}
          least={LIMITS.motorway[0]}
          most={LIMITS.motorway[1]}
          step={5}
          quantity={speed}
          onChange={(motorwayMS) => change({ motorwayMS })}
        />
      )}
    </div>
  );
}

export function ConditionsPanel() {
  const now = conditions.value;
  const { temperature, mass } = units.value;
  const start = trip.value?.start;
  const changed = start && JSON.stringify({ ...start, reserve: now.reserve }) !== JSON.stringify(now);
  const wrong = (field: string) => faults.value.get(field);
  return (
    <section class="panel conditions" aria-labelledby="conditions-title">
      <div class="heading">
        <h2 id="conditions-title">Conditions</h2>
        {changed && (
          <button type="button" class="link" onClick={() => resetTo(start)}>
            Reset
          </button>
        )}
      </div>
      {mode.value === "compare" && (
        <p class="note">
          Those of the first side; the second differs in {SETTINGS[other.value.setting]} alone.
        </p>
      )}
      <Slider
        label="Outside"
        value={now.ambientDegc}
        least={LIMITS.ambient[0]}
        most={LIMITS.ambient[1]}
        step={1}
        quantity={temperature}
        faults={wrong("ambient_temperature_degc")}
        onChange={(ambientDegc) => change({ ambientDegc })}
      />
      <Slider
        label="Cabin"
        value={now.setpointDegc}
        least={LIMITS.setpoint[0]}
        most={LIMITS.setpoint[1]}
        step={1}
        quantity={temperature}
        faults={wrong("cabin_setpoint_degc")}
        onChange={(setpointDegc) => change({ setpointDegc })}
      />
      <Slider
        label="Battery at departure"
        value={now.soc}
        least={LIMITS.soc[0]}
        most={LIMITS.soc[1]}
        step={1}
        quantity={PERCENT}
        faults={wrong("displayed_soc")}
        onChange={(soc) => change({ soc: Math.min(soc, 1) })}
      />
      <Slider
        label="Load besides the driver"
        value={now.payloadKg}
        least={LIMITS.payload[0]}
        most={LIMITS.payload[1]}
        step={10}
        quantity={mass}
        faults={wrong("payload_mass_kg")}
        onChange={(payloadKg) => change({ payloadKg })}
      />
      <Slider
        label="Reserve to keep"
        value={now.reserve}
        least={LIMITS.reserve[0]}
        most={LIMITS.reserve[1]}
        step={1}
        quantity={PERCENT}
        faults={wrong("reserve")}
        onChange={(reserve) => change({ reserve: Math.round(reserve * 100) / 100 })}
      />
      <Motorway />
      <DoorSelect />
    </section>
  );
}

export const SETTINGS = {
  setpointDegc: "the cabin's set-point",
  ambientDegc: "the outside temperature",
  payloadKg: "the load",
  soc: "the charge at departure",
  motorwayMS: "the motorway speed",
};
