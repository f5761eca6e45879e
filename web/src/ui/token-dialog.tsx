import { signal } from "@preact/signals";
import { setTokenProvider } from "../api/client";
import { text } from "../state/preferences";
import { Submit, submitting, useModal } from "./parts";

interface TokenRequest {
  again: boolean;
  resolvers: ((token: string) => void)[];
}

const pending = signal<TokenRequest | null>(null);

/** Request tokens with this dialog; requests that wait at the same time get the same token. */
export function connectTokenDialog(): void {
  setTokenProvider(
    (again) =>
      new Promise((resolve) => {
        const resolvers = [...(pending.value?.resolvers ?? []), resolve];
        pending.value = { again: again || (pending.value?.again ?? false), resolvers };
      }),
  );
}

export function TokenDialog() {
  const now = pending.value;
  const dialog = useModal(now !== null);
  const { token: words } = text.value;
  return (
    <dialog ref={dialog} aria-labelledby="token-title" onCancel={(event) => event.preventDefault()}>
      <form
        method="dialog"
        onSubmit={submitting((form) => {
          const token = new FormData(form).get("token");
          pending.value = null;
          for (const resolve of now?.resolvers ?? []) resolve(String(token ?? "").trim());
        })}
      >
        <h2 id="token-title">{words.title}</h2>
        <p class="note">{words.note}</p>
        <label class="field">
          <span>{words.label}</span>
          <input name="token" type="password" autocomplete="off" required />
        </label>
        {now?.again && <p class="faults">{words.refused}</p>}
        <Submit label={words.send} />
      </form>
    </dialog>
  );
}
