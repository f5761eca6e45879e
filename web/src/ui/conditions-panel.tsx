import { hasMotorway, MOTORWAY_M_S } from "../model/links";
import { PERCENT } from "../model/units";
import { change, conditions, type Door, GARAGE_DEGC, resetTo } from "../state/conditions";
import { faults, mode, other } from "../state/forecast";
import { format, text, units } from "../state/preferences";
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

const DOORS: Door[] = ["parked", "garage", "logged", "unknown"];

function doorText(door: Door): string {
  const { conditions: words } = text.value;
  const shown = (degc: number) => format.value.shown(degc, units.value.temperature);
  if (door === "parked") return words.parked(shown(conditions.value.ambientDegc));
  return door === "garage" ? words.garage(shown(GARAGE_DEGC)) : words[door];
}

function DoorSelect() {
  const known = Object.keys(trip.value?.logged ?? {}).length > 0;
  return (
    <label class="field">
      <span>{text.value.conditions.before}</span>
      <select
        value={conditions.value.door}
        onChange={(event) => change({ door: event.currentTarget.value as Door })}
      >
        {DOORS.filter((door) => known || door !== "logged").map((door) => (
          <option key={door} value={door}>
            {doorText(door)}
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
          label={words.motorway}
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
  const { conditions: words, settings } = text.value;
  const start = trip.value?.start;
  const changed = start && JSON.stringify({ ...start, reserve: now.reserve }) !== JSON.stringify(now);
  const wrong = (field: string) => faults.value.get(field);
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
      <Slider
        label={words.outside}
        value={now.ambientDegc}
        least={LIMITS.ambient[0]}
        most={LIMITS.ambient[1]}
        step={1}
        quantity={temperature}
        faults={wrong("ambient_temperature_degc")}
        onChange={(ambientDegc) => change({ ambientDegc })}
      />
      <Slider
        label={words.cabin}
        value={now.setpointDegc}
        least={LIMITS.setpoint[0]}
        most={LIMITS.setpoint[1]}
        step={1}
        quantity={temperature}
        faults={wrong("cabin_setpoint_degc")}
        onChange={(setpointDegc) => change({ setpointDegc })}
      />
      <Slider
        label={words.soc}
        value={now.soc}
        least={LIMITS.soc[0]}
        most={LIMITS.soc[1]}
        step={1}
        quantity={PERCENT}
        faults={wrong("soc") ?? wrong("displayed_soc")}
        onChange={(soc) => change({ soc: Math.min(soc, 1) })}
      />
      <Slider
        label={words.payload}
        value={now.payloadKg}
        least={LIMITS.payload[0]}
        most={LIMITS.payload[1]}
        step={10}
        quantity={mass}
        faults={wrong("payload_mass_kg")}
        onChange={(payloadKg) => change({ payloadKg })}
      />
      <Slider
        label={words.reserve}
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
