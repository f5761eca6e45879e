/** The cars that the service keeps: made, chosen, taught with logs, shown with their diaries, erased. */

import { useState } from "preact/hooks";
import type { OwnCar } from "../api/documents";
import { storedToken } from "../api/client";
import { isBetter } from "../model/diary";
import { senderAddress, viewAddress } from "../model/to-phone";
import { car, chooseOwn } from "../state/car";
import {
  addCar,
  damagedCars,
  dropCar,
  faultsOfCars,
  isOpen,
  learns,
  ownCars,
  showCar,
  shownCar,
  tokenOf,
} from "../state/own-cars";
import { logs } from "../state/own-logs";
import { openRoad } from "../state/live-drive";
import { text } from "../state/preferences";
import { CarField } from "./car-field";
import { FaultList } from "./faults";
import { OwnCarDiary } from "./own-car-diary";
import { OwnCarLogs } from "./own-car-logs";
import { ToPhone } from "./to-phone";
import { Button, Fold, IconButton, put, Row, Submit, submitting, useModal } from "./parts";

function List() {
  return (
    <ul class="examples">
      {(ownCars.value ?? []).map((row) => (
        <Row key={row.name} onClick={() => void showCar(row.name)} label={row.label}>
          {row.title} · {text.value.ownCars.inDiary(row.in_diary)}
        </Row>
      ))}
      {Object.entries(damagedCars.value).map(([name, faults]) => (
        <li key={name}>
          <span class="name">{name}</span>
          <FaultList faults={faults} />
        </li>
      ))}
    </ul>
  );
}

function NewCar() {
  const { ownCars: words } = text.value;
  return (
    <form
      onSubmit={submitting((form) => {
        const name = new FormData(form).get("name");
        void addCar(String(name ?? "").trim());
      })}
    >
      <h3>{words.newCar}</h3>
      <CarField />
      <p class="note">{words.newCarNote}</p>
      <label class="field">
        <span>{words.name}</span>
        <input name="name" type="text" required maxLength={100} autocomplete="off" />
      </label>
      <Submit label={words.make} />
    </form>
  );
}

function Token({ of }: { of: OwnCar }) {
  const [token, setToken] = useState("");
  const { ownCars: words } = text.value;
  return (
    <Fold title={words.connect}>
      <p class="note">{words.connectNote}</p>
      {token ? (
        <>
          <p>
            <code>{token}</code> <span class="note">{words.tokenOnce}</span>
          </p>
          <ToPhone label={text.value.toPhone.sender} codeFor={(service) => senderAddress(service, token)} />
        </>
      ) : (
        <Button
          onClick={() => void tokenOf(of.name).then((made) => setToken(made ?? ""))}
          label={of.has_token ? words.replaceToken : words.makeToken}
        />
      )}
    </Fold>
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
        <Button
          class={isUsed || !isBetter(of) || logs.value?.car === of.name ? "" : "primary"}
          disabled={isUsed || learns.value}
          onClick={() => {
            chooseOwn(of);
            isOpen.value = false;
          }}
          label={isUsed ? words.used : words.use}
        />
        {of.has_token && (
          <Button
            onClick={() => {
              isOpen.value = false;
              void openRoad(of.name);
            }}
            label={text.value.live.title}
          />
        )}
        {!asks && <Button disabled={learns.value} onClick={() => setAsks(true)} label={words.forget} />}
      </div>
      {asks && (
        <div class="confirm" role="alert">
          <p>{words.forgetAsk(of.label)}</p>
          <div class="actions start">
            <Button onClick={() => setAsks(false)} label={words.keep} />
            <Button
              class="danger"
              onClick={() => {
                if (logs.value?.car === of.name) logs.value = null;
                void dropCar(of.name);
              }}
              label={words.forgetNow}
            />
          </div>
        </div>
      )}
      {!learns.value && <OwnCarLogs car={of.name} />}
      <OwnCarDiary of={of} />
      <Token of={of} key={of.name} />
      {of.has_token && (
        <Fold title={text.value.toPhone.view}>
          <p class="note">{text.value.toPhone.viewNote}</p>
          <ToPhone
            label={text.value.toPhone.view}
            codeFor={(service) => viewAddress(service, of.name, storedToken())}
          />
        </Fold>
      )}
    </>
  );
}

export function OwnCarsDialog() {
  const dialog = useModal(isOpen.value);
  const { ownCars: words } = text.value;
  const now = shownCar.value;
  const close = put(isOpen, false);
  return (
    <dialog ref={dialog} class="wide" aria-labelledby="own-cars-title" onClose={close}>
      <div class="heading">
        <h2 id="own-cars-title">{now ? now.label : words.title}</h2>
        {now && <Button class="link" onClick={put(shownCar, null)} label={words.all} />}
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
