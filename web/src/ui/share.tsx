/** A plan as a link, and on paper. */

import { useState } from "preact/hooks";
import { car } from "../state/car";
import { conditions } from "../state/conditions";
import { linkOf } from "../state/link";
import { text } from "../state/preferences";
import { trip } from "../state/trip";
import { IconButton } from "./parts";

const SHOWN_MS = 4000;

export function ShareTools() {
  const [said, setSaid] = useState("");
  const { share } = text.value;
  const say = (words: string) => {
    setSaid(words);
    setTimeout(() => setSaid(""), SHOWN_MS);
  };
  const copy = async () => {
    const link = trip.value ? linkOf(trip.value, conditions.value, car.value) : "";
    if (!link) return say(share.noLink);
    const address = new URL(link, location.href).href;
    history.replaceState(null, "", link);
    try {
      await navigator.clipboard.writeText(address);
      say(share.copied);
    } catch {
      say(share.inAddress); // the browser allows no copying here
    }
  };
  return (
    <div class="share">
      <span role="status" class="figures">
        {said}
      </span>
      <IconButton icon="link" label={share.copy} onClick={() => void copy()} />
      <IconButton icon="print" label={share.print} onClick={() => window.print()} />
    </div>
  );
}
