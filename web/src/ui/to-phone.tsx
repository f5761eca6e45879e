/** A QR code with an address of this service and a token: for the app that sends, or to open the view on a phone. */

import { useState } from "preact/hooks";
import { isOnlyHere, serviceAddress } from "../model/to-phone";
import { text } from "../state/preferences";
import { Qr } from "./qr";

interface Props {
  /** What the code is for. */
  label: string;
  /** The text of the code for the address of the service. */
  codeFor: (service: URL) => string;
}

export function ToPhone({ label, codeFor }: Props) {
  const [typed, setTyped] = useState(location.origin + location.pathname);
  const { toPhone: words } = text.value;
  const service = serviceAddress(typed);
  const isReached = service !== null && !isOnlyHere(service);
  return (
    <div class="to-phone">
      <label class="field">
        <span>{words.address}</span>
        <input
          type="url"
          value={typed}
          spellcheck={false}
          onInput={(event) => setTyped(event.currentTarget.value)}
        />
      </label>
      {service && !isReached && <p class="note">{words.onlyHere}</p>}
      {isReached && service.protocol === "http:" && <p class="note">{words.noTls}</p>}
      {service && isReached && (
        <figure>
          <Qr of={codeFor(service)} label={label} />
          <figcaption>
            {label}
            <code>{codeFor(service)}</code>
          </figcaption>
        </figure>
      )}
    </div>
  );
}
