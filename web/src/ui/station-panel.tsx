/** What a driver wants of charging stations: to stop at one, to avoid it, to prefer its network. */

import type { Place, Station } from "../api/documents";
import { isPreferred, isSame, networkOf, placeOfStation } from "../model/stations";
import { POWER } from "../model/units";
import { chargingPlan } from "../state/charging";
import { choose, passBy, stopAt } from "../state/catalogue";
import { choice, placesOfJourney, vias } from "../state/journey";
import { format, text } from "../state/preferences";
import { Button, IconButton } from "./parts";
import { Select } from "./select";
import { chargerParts } from "./wording";

function avoid(station: Place): void {
  vias.value = vias.value.filter((one) => !one || !isSame(one, station));
  choose({ avoid: [...choice.value.avoid, station] });
}

function useAgain(station: Place): void {
  choose({ avoid: choice.value.avoid.filter((one) => !isSame(one, station)) });
}

function prefer(network: string, wanted: boolean): void {
  const others = choice.value.networks.filter((one) => one !== network);
  choose({ networks: wanted ? [...others, network] : others });
}

/** Stop at a station, or avoid it; nothing while a place of the journey is missing. */
export function StationActions({ of }: { of: Station }) {
  const { map: words, journey } = text.value;
  const place = placeOfStation(of, journey.unnamedStation);
  const isStop = vias.value.some((one) => one && isSame(one, place));
  const isPlanned = chargingPlan.value?.stops.some(({ station }) => isSame(station, place));
  const isAvoided = choice.value.avoid.some((one) => isSame(one, place));
  if (!placesOfJourney()) return null;
  return (
    <span class="actions">
      <Button
        class="link"
        onClick={() => (isStop ? passBy : stopAt)(place)}
        label={isStop ? words.passBy : isPlanned ? words.keepStop : words.stopHere}
      />
      <Button
        class="link"
        onClick={() => (isAvoided ? useAgain : avoid)(place)}
        label={isAvoided ? words.useAgain : words.avoid}
      />
    </span>
  );
}

/** The station that is chosen on the map or in the list, with what can be done. */
export function StationPanel({ of, known }: { of: Station; known: readonly Station[] }) {
  const { map: words, journey } = text.value;
  const names = known.map(({ name }) => name);
  const network = networkOf(of.name, names);
  const isWanted = isPreferred(of.name, choice.value.networks);
  return (
    <div class="station" role="status">
      <b>{of.name || journey.unnamedStation}</b> <span class="figures">{chargerParts(of).join(" · ")}</span>
      <StationActions of={of} />
      {network && placesOfJourney() && (
        <Button
          class="link"
          onClick={() => prefer(network, !isWanted)}
          label={isWanted ? words.noPreference(network) : words.prefer(network)}
        />
      )}
    </div>
  );
}

/** Stations in view by name, for who cannot click on the map. */
export function StationList({
  known,
  chosen,
  onChoose,
}: {
  known: readonly Station[];
  chosen: Station | null;
  onChoose: (station: Station | null) => void;
}) {
  const { map: words, journey } = text.value;
  const keyOf = ({ latitude_deg, longitude_deg }: Station) => `${latitude_deg} ${longitude_deg}`;
  const options = known.map((station): [string, string] => [
    keyOf(station),
    `${station.name || journey.unnamedStation} · ${format.value.shown(station.power_w, POWER)}`,
  ]);
  options.sort(([, one], [, other]) => one.localeCompare(other, undefined, { numeric: true }));
  return (
    <Select
      label={words.stations}
      value={chosen ? keyOf(chosen) : ""}
      options={[["", words.chooseStation], ...options]}
      onChoose={(key) => onChoose(known.find((station) => keyOf(station) === key) ?? null)}
    />
  );
}

/** Stations that are avoided and networks that are preferred, each to be taken back. */
export function Wishes() {
  const { avoid: avoided, networks } = choice.value;
  const { map: words } = text.value;
  if (avoided.length + networks.length === 0) return null;
  const wishes = [
    ...avoided.map((one) => ({
      wish: words.avoided(one.name),
      label: `${words.useAgain}: ${one.name}`,
      onClick: () => useAgain(one),
    })),
    ...networks.map((one) => ({
      wish: words.preferred(one),
      label: words.noPreference(one),
      onClick: () => prefer(one, false),
    })),
  ];
  return (
    <ul class="wishes">
      {wishes.map(({ wish, ...rest }, k) => (
        <li key={k}>
          {wish}
          <IconButton icon="close" {...rest} />
        </li>
      ))}
    </ul>
  );
}
