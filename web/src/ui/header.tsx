import { type System, unitsOf } from "../model/units";
import { car, choices, chooseModel } from "../state/car";
import { openRoad } from "../state/live-drive";
import { ownCars } from "../state/own-cars";
import { chosenLanguage, language, system, text, type Theme, theme } from "../state/preferences";
import { type Language, LANGUAGES } from "../text";
import { CarField } from "./car-field";
import { Choice } from "./choice";
import { IconButton, into, put } from "./parts";
import { Select } from "./select";

const THEMES: [Theme, "system" | "sun" | "moon"][] = [
  ["system", "system"],
  ["light", "sun"],
  ["dark", "moon"],
];

const SETTINGS = "settings";
const SYSTEMS: System[] = ["metric", "british", "imperial"];

const LANGUAGE_NAMES = Object.entries(LANGUAGES) as [Language, string][];

function ThemeButton() {
  const now = THEMES.findIndex(([name]) => name === theme.value);
  const [name, icon] = THEMES[now] as (typeof THEMES)[number];
  const { header } = text.value;
  const next = THEMES[(now + 1) % THEMES.length] as (typeof THEMES)[number];
  return (
    <IconButton
      icon={icon}
      label={header.changeTheme(header.theme[name])}
      title={header.theme[name]}
      onClick={put(theme, next[0])}
    />
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
      onChoose={into(chosenLanguage)}
    />
  );
}

/** Several models for one car: a choice for those who fitted them. */
function ModelSelect() {
  const { header } = text.value;
  if (choices.value.length < 2 || car.value?.own) return null;
  return (
    <Select
      isBare
      label={header.model}
      value={car.value?.model ?? ""}
      options={choices.value.map(({ name, model }) => [name, header.modelOption(name, model.trips)])}
      onChoose={chooseModel}
    />
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
      <CarField />
      <ModelSelect />
      <div class="tools">
        {ownCars.value && (
          <IconButton icon="wheel" label={text.value.live.title} onClick={() => void openRoad()} />
        )}
        <IconButton
          icon="gear"
          class="quiet gear"
          label={text.value.header.settings}
          popovertarget={SETTINGS}
        />
        <div class="settings" id={SETTINGS} popover="auto">
          <Choice
            label={text.value.header.units}
            class="small"
            value={system.value}
            options={SYSTEMS.map((name) => {
              const { distance, temperature } = unitsOf(name);
              return [name, `${distance.unit}\u00a0${temperature.unit}`] as const;
            })}
            onChoose={into(system)}
          />
          <LanguageChoice />
          <ThemeButton />
        </div>
      </div>
    </header>
  );
}
