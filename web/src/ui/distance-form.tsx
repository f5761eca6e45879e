import { useState } from "preact/hooks";
import { type Kind, KINDS, linksOfDistance, type RoadType, SHARES, SPEEDS_M_S } from "../model/distance";
import { PERCENT } from "../model/units";
import { chooseRoute } from "../state/catalogue";
import { format, text, units } from "../state/preferences";
import { NumberField } from "./number-field";
import { Select } from "./select";

const START_M = 180_000;
const TYPES: RoadType[] = ["town", "country", "motorway"];

/** The shares and speeds that a kind of road stands for. */
function assumedText(kind: Kind): string {
  const { distanceForm: words } = text.value;
  const { list, shown } = format.value;
  const parts = TYPES.filter((type) => SHARES[kind][type] > 0).map((type) =>
    words.part(
      shown(SHARES[kind][type], PERCENT),
      words.types[type],
      shown(SPEEDS_M_S[type], units.value.speed),
    ),
  );
  return words.assumed(list(parts));
}

/** A trip by distance and kind of road, for a service without a router. */
export function DistanceForm() {
  const [distanceM, setDistance] = useState<number | null>(START_M);
  const [kind, setKind] = useState<Kind>("motorway");
  const { distanceForm: words } = text.value;
  const { distance } = units.value;
  return (
    <form
      class="journey"
      onSubmit={(event) => {
        event.preventDefault();
        if (!distanceM || distanceM <= 0) return;
        const title = `${format.value.shown(distanceM, distance, 0)}, ${words.kinds[kind]}`;
        void chooseRoute(JSON.stringify(linksOfDistance(distanceM, kind)), title, "distance", 0);
      }}
    >
      <div class="inline">
        <NumberField label={words.distance} value={distanceM} quantity={distance} onChange={setDistance} />
      </div>
      <Select
        label={words.kind}
        value={kind}
        options={KINDS.map((name) => [name, words.kinds[name]])}
        onChoose={setKind}
      />
      <p class="note">{assumedText(kind)}</p>
      <button type="submit" class="primary">
        {words.use}
      </button>
    </form>
  );
}
