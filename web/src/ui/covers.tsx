import { map } from "../state/journey";
import { text } from "../state/preferences";
import { Said } from "./said";

/** Which region the map covers; nothing where the service does not know it. */
export function Covers() {
  const covers = map.value?.covers;
  if (!covers) return null;
  return (
    <span class="covers">
      {" "}
      {text.value.journey.covers} <Said of={covers} />.
    </span>
  );
}
