import type { Forecast } from "../api/documents";
import { climbToReserveM } from "../model/arrival";
import { climbsOf } from "../model/profile";
import { shownProfile } from "../state/drive";
import { requested } from "../state/forecast";
import { map } from "../state/journey";
import { format, text, units } from "../state/preferences";
import { trip } from "../state/trip";
import { Said } from "./said";

/** How much the road climbs and where its heights are from; or that this is unknown, and which climb would change the answer. */
export function Climb({ of }: { of: Forecast }) {
  const { climb: words } = text.value;
  const { shown } = format.value;
  const { height } = units.value;
  if (of.climb) {
    const changesM = climbToReserveM(of, requested.value.at.reserve);
    const { expected_m: endM } = of.climb;
    const where = endM !== null && (endM < 0 ? words.below : words.above)(shown(Math.abs(endM), height));
    return (
      <>
        {words.unknown} {where} {changesM !== null && changesM > 0 && words.changes(shown(changesM, height))}
      </>
    );
  }
  const heightsM = shownProfile.value?.elevationM;
  if (!heightsM) return null;
  const [upM, downM] = climbsOf(heightsM);
  const from = trip.value?.stops ? map.value?.terrain.source : "";
  return (
    <>
      {words.known(shown(upM, height), shown(downM, height))}
      {from && (
        <>
          {" "}
          {words.from} <Said of={from} />.
        </>
      )}
    </>
  );
}
