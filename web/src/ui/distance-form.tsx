import { useEffect, useState } from "preact/hooks";
import { type Kind, KINDS, type RoadType, sharesOver } from "../model/distance";
import { PERCENT } from "../model/units";
import { chooseDistance } from "../state/catalogue";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";
import { NumberField } from "./number-field";
import { Select } from "./select";

const START_M = 50_000;
/** What the service answers [m]. */
const [LEAST_M, MOST_M] = [500, 2_000_000];
const TYPES: RoadType[] = ["town", "country", "motorway"];

/** The shares that a kind of road stands for. */
function sharesText(distanceM: number, kind: Kind): string {
  const { distanceForm: words } = text.value;
  const { list, shown } = format.value;
  const shares = sharesOver(distanceM, kind);
  const parts = TYPES.filter((type) => shares[type] > 0).map(
    (type) => `${shown(shares[type], PERCENT)} ${words.types[type]}`,
  );
  return words.assumed(list(parts));
}

/** A trip by distance and kind of road; its answer follows what is typed. */
export function DistanceForm() {
  const known = trip.value?.distance;
  const [distanceM, setDistance] = useState<number | null>(known?.distanceM ?? START_M);
  const [kind, setKind] = useState<Kind>(known?.kind ?? "mixed");
  const { distanceForm: words } = text.value;
  const { distance } = units.value;
  const isSound = (metres: number | null): metres is number =>
    metres !== null && metres >= LEAST_M && metres <= MOST_M;
  const ask = (nextM: number | null, next: Kind) => {
    if (isSound(nextM)) chooseDistance(nextM, next);
    else trip.value = null; // the answer to another distance does not stay up
  };
  useEffect(() => {
    if (!trip.value?.distance) ask(distanceM, kind);
  }, []);
  return (
    <div class="journey">
      <div class="inline">
        <NumberField
          label={text.value.trip.sources.distance}
          value={distanceM}
          quantity={distance}
          fault={
            isSound(distanceM)
              ? ""
              : words.bounds(
                  format.value.figure(distance.from(LEAST_M), 1),
                  format.value.shown(MOST_M, distance, 0),
                )
          }
          onChange={(next) => {
            setDistance(next);
            ask(next, kind);
          }}
        />
      </div>
      <Select
        label={words.kind}
        value={kind}
        options={KINDS.map((name) => [name, words.kinds[name]])}
        onChoose={(next) => {
          setKind(next);
          ask(distanceM, next);
        }}
      />
      <p class="note">{sharesText(isSound(distanceM) ? distanceM : START_M, kind)}</p>
    </div>
  );
}
