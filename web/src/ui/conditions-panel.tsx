import type { ComponentChildren } from "preact";
import { useId } from "preact/hooks";
import { FIELDS } from "../../generated/fields";
import { localOf } from "../model/clock";
import {
  type ChoiceName,
  CHOICES,
  type NumberName,
  NUMBERS,
  SEVERAL,
  type SeveralName,
} from "../model/fields";
import { hasMotorway } from "../model/links";
import {
  ASKED,
  BEFORE_DEPARTURE,
  type BeforeDeparture,
  change,
  type Conditions,
  conditions,
  GARAGE_DEGC,
  isUsual,
  resetTo,
  WEATHER,
} from "../state/conditions";
import { source } from "../state/catalogue";
import { departure, faults, mode, other } from "../state/forecast";
import { map } from "../state/journey";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";
import { panelIsOpen } from "./chips";
import { FaultList } from "./faults";
import { Button, IconButton, put, Tick } from "./parts";
import { Select } from "./select";
import type { SettingName } from "./settings";
import { Slider } from "./slider";

/** Sliders that are always there, in their order. */
const SLIDERS = [
  "ambient_temperature_degc",
  "cabin_setpoint_degc",
  "soc",
  "payload_mass_kg",
  "reserve",
] as const;

/** Values of a field without a usual one when it is ticked; the middle of its bounds where none is here. */
const FIRST_VALUES: Partial<Record<SettingName, number>> = {
  motorwayMS: 130 / 3.6,
  wind_speed_m_s: 30 / 3.6,
  wind_from_deg: 270,
  rain_mm_h: 2,
  pressure_pa: 101_300,
  tyre_pressure: 0.9,
};

const OPTIONAL = NUMBERS.filter((name) => ASKED.includes(name as never) && !isUsual(name)) as SettingName[];

function firstValue(name: SettingName): number {
  const first = FIRST_VALUES[name];
  if (first !== undefined || !(name in FIELDS)) return first ?? 0;
  const { minimum, maximum } = FIELDS[name as NumberName];
  return (minimum + maximum) / 2;
}

function faultsOf(name: string) {
  return faults.value.get(name) ?? [];
}

/** A slider that is there once it is ticked; without it the value is unknown, or as planned. */
function Ticked({ name, label, slider = label }: { name: SettingName; label: string; slider?: string }) {
  const now = conditions.value[name];
  const set = (value: number | null) => change({ [name]: value } as Partial<Conditions>);
  return (
    <div class="field">
      <Tick
        label={label}
        checked={now !== null}
        onChange={(checked) => set(checked ? firstValue(name) : null)}
      />
      {now !== null && (
        <Slider
          setting={name}
          label={slider}
          isTitled={slider === label}
          value={now}
          faults={faultsOf(name)}
          onChange={set}
        />
      )}
    </div>
  );
}

function Motorway() {
  const links = trip.value?.links;
  if (!links || !hasMotorway(links)) return null;
  const { conditions: words } = text.value;
  return <Ticked name="motorwayMS" label={words.limitMotorway} slider={words.fields.motorwayMS} />;
}

/** The country counts where the heights of the road are unknown. */
function isAsked(name: ChoiceName): boolean {
  return name !== "terrain" || departure.value?.climb != null;
}

function ChoiceOf({ name }: { name: ChoiceName }) {
  const { fields, choices } = text.value.conditions;
  const words: Record<string, string> = choices[name];
  return (
    <Select<string>
      label={fields[name]}
      value={conditions.value[name]}
      options={FIELDS[name].choices.map((choice) => [choice, words[choice] ?? choice])}
      onChoose={(value) => change({ [name]: value } as Partial<Conditions>)}
    />
  );
}

function Several({ name }: { name: SeveralName }) {
  const { fields, choices } = text.value.conditions;
  const chosen = conditions.value[name] ?? [];
  return (
    <fieldset class="field ticks">
      <legend>{fields[name]}</legend>
      {FIELDS[name].choices.map((choice) => (
        <Tick
          key={choice}
          label={choices[name][choice]}
          checked={chosen.includes(choice)}
          onChange={(checked) => {
            const others = chosen.filter((one) => one !== choice);
            const next = checked ? [...others, choice] : others;
            change({ [name]: next.length > 0 ? next : null });
          }}
        />
      ))}
    </fieldset>
  );
}

/** What few trips need, behind a heading that counts what is set. */
function More({ children }: { children: ComponentChildren }) {
  const set = [...OPTIONAL, ...SEVERAL].filter((name) => conditions.value[name] !== null).length;
  return (
    <details class="more" open={set > 0}>
      <summary>{text.value.conditions.more}</summary>
      <div class="fields">{children}</div>
    </details>
  );
}

function beforeDepartureText(choice: BeforeDeparture): string {
  const { conditions: words } = text.value;
  const shown = (degc: number) => format.value.shown(degc, units.value.temperature);
  if (choice === "parked") return words.parked(shown(conditions.value.ambient_temperature_degc));
  return choice === "garage" ? words.garage(shown(GARAGE_DEGC)) : words[choice];
}

function BeforeDepartureSelect() {
  const known = Object.keys(trip.value?.logged ?? {}).length > 0;
  const offered = BEFORE_DEPARTURE.filter((choice) => known || choice !== "logged");
  return (
    <Select
      label={text.value.conditions.before}
      value={conditions.value.beforeDeparture}
      options={offered.map((choice) => [choice, beforeDepartureText(choice)])}
      onChoose={(beforeDeparture) => change({ beforeDeparture })}
    />
  );
}

type YesOrNo = "warmCabin" | "warmBattery" | "preheatForStops" | "weatherOfHour";

function Yes({ name, label }: { name: YesOrNo; label: string }) {
  return (
    <Tick
      label={label}
      checked={conditions.value[name]}
      onChange={(checked) => change({ [name]: checked })}
    />
  );
}

/** Time of departure, and where the weather comes from; only a journey has them. */
function Departs() {
  const { conditions: words } = text.value;
  const { departsAt } = conditions.value;
  const id = useId();
  if (source.value !== "journey") return null;
  return (
    <div class="field departs">
      <label for={id}>{words.departs}</label>
      <div class="inline">
        <input
          id={id}
          type="datetime-local"
          value={departsAt ?? ""}
          min={localOf(new Date())}
          onChange={(event) => change({ departsAt: event.currentTarget.value || null })}
        />
        {departsAt === null ? (
          <span class="figures">{words.now}</span>
        ) : (
          <Button class="link" onClick={() => change({ departsAt: null })} label={words.leaveNow} />
        )}
      </div>
      <FaultList faults={faultsOf("departs_at")} />
      {map.value?.weather && <Yes name="weatherOfHour" label={words.fromServer} />}
    </div>
  );
}

export function ConditionsPanel() {
  const now = conditions.value;
  const { conditions: words } = text.value;
  const start = trip.value?.start;
  const charges = source.value === "journey" && (map.value?.stations ?? 0) > 0;
  const byServer = now.weatherOfHour && source.value === "journey";
  const isGiven = (name: string) => byServer && WEATHER.includes(name);
  const changed = start && JSON.stringify({ ...start, reserve: now.reserve }) !== JSON.stringify(now);
  return (
    <section
      class={`panel conditions${panelIsOpen.value ? " open" : ""}`}
      aria-labelledby="conditions-title"
      onKeyDown={(event) => {
        // eslint-disable-next-line page/text -- name of a key
        if (event.key === "Escape") panelIsOpen.value = false;
      }}
    >
      <div class="heading">
        <h2 id="conditions-title">{words.title}</h2>
        {changed && <Button class="link" onClick={() => resetTo(start)} label={words.reset} />}
        <IconButton icon="close" class="quiet shut" label={words.shut} onClick={put(panelIsOpen, false)} />
      </div>
      <Departs />
      {mode.value === "compare" && <p class="note">{words.compared(words.fields[other.value.setting])}</p>}
      {SLIDERS.filter((name) => !isGiven(name)).map((setting) => (
        <Slider
          key={setting}
          setting={setting}
          label={words.fields[setting]}
          value={now[setting]}
          faults={faultsOf(setting)}
          onChange={(si) => change({ [setting]: si })}
        />
      ))}
      <Motorway />
      {CHOICES.filter(isAsked).map((name) => (
        <ChoiceOf key={name} name={name} />
      ))}
      <BeforeDepartureSelect />
      <fieldset class="field ticks">
        <legend>{words.warmed}</legend>
        <Yes name="warmCabin" label={words.fields.cabin_setpoint_degc} />
        <Yes name="warmBattery" label={words.battery} />
        {charges && <Yes name="preheatForStops" label={words.forStops} />}
      </fieldset>
      {charges && (
        <Slider
          setting="stopOverheadS"
          label={words.fields.stopOverheadS}
          value={now.stopOverheadS}
          onChange={(stopOverheadS) => change({ stopOverheadS })}
        />
      )}
      <More>
        {OPTIONAL.filter(
          (name) => !isGiven(name) && (name !== "wind_from_deg" || now.wind_speed_m_s !== null),
        ).map((name) => (
          <Ticked key={name} name={name} label={words.fields[name]} />
        ))}
        {SEVERAL.map((name) => (
          <Several key={name} name={name} />
        ))}
        <FaultList faults={SEVERAL.flatMap(faultsOf)} />
      </More>
    </section>
  );
}
