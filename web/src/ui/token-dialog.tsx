import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { whenTokenIsWanted } from "../api/client";
import { text } from "../state/preferences";

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
  const { token: words } = text.value;
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
        <h2 id="token-title">{words.title}</h2>
        <p class="note">{words.note}</p>
        <label class="field">
          <span>{words.label}</span>
          <input name="token" type="password" autocomplete="off" required />
        </label>
        {now?.again && <p class="faults">{words.refused}</p>}
        <button type="submit" class="primary">
          {words.send}
        </button>
      </form>
    </dialog>
  );
}
