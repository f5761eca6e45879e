/** The conditions in a line that stays in view; it opens their panel. */

import { signal } from "@preact/signals";
import { MINUTES, PERCENT } from "../model/units";
import { conditions, USUAL } from "../state/conditions";
import { shownForecast } from "../state/drive";
import { format, text, units } from "../state/preferences";
import { source } from "../state/catalogue";
import { Icon } from "./icons";
import { clockText } from "./wording";

/** Whether the panel is open on a phone. */
export const panelIsOpen = signal(false);

/** The conditions in words, the most changed ones first to last. */
function parts(): string[] {
  const now = conditions.value;
  const { conditions: words } = text.value;
  const { shown } = format.value;
  const { temperature, mass, speed } = units.value;
  const isJourney = source.value === "journey";
  const leaves = now.departsAt === null ? words.now : clockText(new Date(now.departsAt), new Date());
  const weather = now.weatherOfHour && isJourney;
  const parts = [
    isJourney && leaves,
    weather ? words.weatherOfHour : shown(now.ambient_temperature_degc, temperature),
    shown(now.soc, PERCENT),
    now.wind_speed_m_s !== null &&
      !weather &&
      `${words.fields.wind_speed_m_s} ${shown(now.wind_speed_m_s, speed)}`,
    now.rain_mm_h !== null && !weather && words.fields.rain_mm_h,
    ...(now.extras ?? []).map((extra) => words.choices.extras[extra]),
    now.tyre_pressure !== null && words.tyres(shown(now.tyre_pressure, PERCENT)),
    now.climate !== "auto" && `${words.fields.climate}: ${words.choices.climate[now.climate]}`,
    now.warmCabin && words.warmCabin,
    now.warmBattery && words.warmBattery,
    now.payload_mass_kg > 0 && `+${shown(now.payload_mass_kg, mass)}`,
    isJourney &&
      now.stopOverheadS !== USUAL.stopOverheadS &&
      words.perStop(shown(now.stopOverheadS, MINUTES)),
    words.reserve(shown(now.reserve, PERCENT)),
  ];
  return parts.filter((part) => part !== false);
}

function open(): void {
  panelIsOpen.value = !panelIsOpen.value;
  if (!panelIsOpen.value) return;
  requestAnimationFrame(() => {
    const panel = document.querySelector<HTMLElement>(".conditions");
    panel?.scrollIntoView({ block: "nearest" });
    // eslint-disable-next-line page/text -- a selector
    panel?.querySelector<HTMLElement>("input, select")?.focus({ preventScroll: true });
  });
}

export function Chips() {
  if (!shownForecast.value && source.value !== "distance" && source.value !== "journey") return null;
  return (
    <button type="button" class="chips" aria-expanded={panelIsOpen.value} onClick={open}>
      <Icon name="sliders" />
      <span class="unseen">{text.value.conditions.open}: </span>
      {parts().map((part) => (
        <span key={part} class="chip">
          {part}
        </span>
      ))}
    </button>
  );
}
