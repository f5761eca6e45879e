import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { whenTokenIsWanted } from "../api/client";

interface Asked {
  again: boolean;
  answers: ((token: string) => void)[];
}

const asked = signal<Asked | null>(null);

/** Let the client ask through this dialog; requests that wait at the same time share one answer. */
export function askHere(): void {
  whenTokenIsWanted(
    (again) =>
      new Promise((resolve) => {
        const answers = [...(asked.value?.answers ?? []), resolve];
        asked.value = { again: again || (asked.value?.again ?? false), answers };
      }),
  );
}

export function TokenDialog() {
  const dialog = useRef<HTMLDialogElement>(null);
  const now = asked.value;
  useEffect(() => {
    if (now) dialog.current?.showModal();
    else dialog.current?.close();
  }, [now]);
  return (
    <dialog ref={dialog} aria-labelledby="token-title" onCancel={(event) => event.preventDefault()}>
      <form
        method="dialog"
        onSubmit={(event) => {
          event.preventDefault();
          const token = new FormData(event.currentTarget).get("token");
          asked.value = null;
          for (const answer of now?.answers ?? []) answer(String(token ?? "").trim());
        }}
      >
        <h2 id="token-title">This service asks for a token</h2>
        <p class="note">It is kept until this tab is closed, and sent to this service alone.</p>
        <label class="field">
          <span>Token</span>
          <input name="token" type="password" autocomplete="off" required />
        </label>
        {now?.again && <p class="faults">That token was not accepted.</p>}
        <button type="submit" class="primary">
          Continue
        </button>
      </form>
    </dialog>
  );
}
