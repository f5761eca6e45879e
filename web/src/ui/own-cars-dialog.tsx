/** The cars that the service keeps: made, chosen, taught with logs, shown with their diaries, erased. */

import { signal } from "@preact/signals";
import { useState } from "preact/hooks";
import type { OwnCar } from "../api/documents";
import { car, vehicle } from "../state/car";
import {
  addCar,
  dropCar,
  faultsOfCars,
  learns,
  ownCars,
  showCar,
  shownCar,
  tokenOf,
  useCar,
} from "../state/own-cars";
import { logs } from "../state/own-logs";
import { openRoad } from "../state/live-drive";
import { text } from "../state/preferences";
import { FaultList } from "./faults";
import { OwnCarDiary } from "./own-car-diary";
import { OwnCarLogs } from "./own-car-logs";
import { IconButton, useModal } from "./parts";

const open = signal(false);

/** Open the dialog, with the car of a name where one is given. */
export function openOwnCars(name = ""): void {
  open.value = true;
  const [only] = ownCars.value ?? [];
  const wanted = name || (ownCars.value?.length === 1 ? only?.name : "");
  if (wanted) void showCar(wanted);
}

function List() {
  const { ownCars: words } = text.value;
  return (
    <ul class="examples">
      {(ownCars.value ?? []).map((row) => (
        <li key={row.name}>
          <button type="button" onClick={() => void showCar(row.name)}>
            <span class="name">{row.label}</span>
            <span class="figures">
              {row.title} · {words.inDiary(row.in_diary)}
            </span>
          </button>
        </li>
      ))}
    </ul>
  );
}

function NewCar() {
  const { ownCars: words } = text.value;
  const title = vehicle.value?.title ?? car.value?.title ?? "";
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        const name = new FormData(event.currentTarget).get("name");
        void addCar(String(name ?? "").trim());
      }}
    >
      <h3>{words.newCar}</h3>
      <p class="note">{words.newCarNote(title)}</p>
      <label class="field">
        <span>{words.name}</span>
        <input name="name" type="text" required maxLength={100} autocomplete="off" />
      </label>
      <button type="submit" class="primary">
        {words.make}
      </button>
    </form>
  );
}

function Token({ of }: { of: OwnCar }) {
  const [token, setToken] = useState("");
  const { ownCars: words } = text.value;
  return (
    <details class="as-table">
      <summary>{words.connect}</summary>
      <p class="note">{words.connectNote}</p>
      {token ? (
        <p>
          <code>{token}</code> <span class="note">{words.tokenOnce}</span>
        </p>
      ) : (
        <button type="button" onClick={() => void tokenOf(of.name).then((made) => setToken(made ?? ""))}>
          {of.has_token ? words.replaceToken : words.makeToken}
        </button>
      )}
    </details>
  );
}

function Shown({ of }: { of: OwnCar }) {
  const [asks, setAsks] = useState(false);
  const { ownCars: words } = text.value;
  const isUsed = car.value?.own === of.name;
  return (
    <>
      <p class="note">{of.title}</p>
      <div class="actions start">
        <button
          type="button"
          class={isUsed ? "" : "primary"}
          disabled={isUsed}
          onClick={() => {
            useCar(of);
            open.value = false;
          }}
        >
          {isUsed ? words.used : words.use}
        </button>
        {of.has_token && (
          <button
            type="button"
            onClick={() => {
              open.value = false;
              void openRoad(of.name);
            }}
          >
            {text.value.live.title}
          </button>
        )}
        {!asks && (
          <button type="button" disabled={learns.value} onClick={() => setAsks(true)}>
            {words.forget}
          </button>
        )}
      </div>
      {asks && (
        <div class="confirm" role="alert">
          <p>{words.forgetAsk(of.label)}</p>
          <div class="actions start">
            <button type="button" onClick={() => setAsks(false)}>
              {words.keep}
            </button>
            <button
              type="button"
              class="danger"
              onClick={() => {
                if (logs.value?.car === of.name) logs.value = null;
                void dropCar(of.name);
              }}
            >
              {words.forgetNow}
            </button>
          </div>
        </div>
      )}
      {!learns.value && <OwnCarLogs car={of.name} />}
      <OwnCarDiary of={of} />
      <Token of={of} key={of.name} />
    </>
  );
}

export function OwnCarsDialog() {
  const dialog = useModal(open.value);
  const { ownCars: words } = text.value;
  const now = shownCar.value;
  const close = () => {
    open.value = false;
  };
  return (
    <dialog ref={dialog} class="wide" aria-labelledby="own-cars-title" onClose={close}>
      <div class="heading">
        <h2 id="own-cars-title">{now ? now.label : words.title}</h2>
        {now && (
          <button
            type="button"
            class="link"
            onClick={() => {
              shownCar.value = null;
            }}
          >
            {words.all}
          </button>
        )}
        <IconButton icon="close" label={text.value.close} onClick={close} />
      </div>
      {now ? (
        <Shown of={now} key={now.name} />
      ) : (
        <>
          <p>{words.intro}</p>
          <List />
          <FaultList faults={faultsOfCars.value} />
          <NewCar />
        </>
      )}
    </dialog>
  );
}
