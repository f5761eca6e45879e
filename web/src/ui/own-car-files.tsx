/** Files of logs: what becomes of each, those first that cannot be read, and what can be done about it. */

import { useRef, useState } from "preact/hooks";
import type { Fault } from "../api/documents";
import {
  type Group,
  GROUPS,
  leaveOut,
  logFiles,
  logs,
  type LogFile,
  unreadable,
  useAgain,
} from "../state/own-logs";
import { format, text } from "../state/preferences";
import { placeText, said } from "../state/messages";
import { Said } from "./said";
import { Button } from "./parts";

/** So many files are listed without being asked for. */
const FEW = 10;
const WITHOUT_BUTTON = ["waiting", "sending", "sent"];

/** Why a file is not used, or not as a whole. */
function Why({ of, faults }: { of: string; faults: Fault[] }) {
  const [first] = faults;
  if (!first) return null;
  const where = first.where.replace(of, "").trim();
  const parts = [said(first.what).text, placeText(where), said(first.got ?? "").text].filter((part) => part);
  return (
    <span class="why">
      {parts.join(": ")}
      {first.fix && ". "}
      {first.fix && <Said of={first.fix} />}
      {faults.length > 1 && ` ${text.value.problems.more(faults.length - 1)}`}
    </span>
  );
}

function Row({ of }: { of: LogFile }) {
  const { ownCars: words } = text.value;
  const { name, state, rows, rows_used, faults } = of;
  const isOut = state === "ignored";
  const shown =
    state === "part" ? words.partOf(format.value.figure(rows_used, 0), format.value.figure(rows, 0)) : null;
  return (
    <li class={state}>
      <span class="name">{name}</span>
      <span class="state">{shown ?? words.states[state]}</span>
      {!WITHOUT_BUTTON.includes(state) && (
        <Button
          class="link"
          aria-label={isOut ? words.useFile(name) : words.leaveOutFile(name)}
          onClick={() => void (isOut ? useAgain(of) : leaveOut([of]))}
          label={isOut ? words.use1 : words.leaveOut1}
        />
      )}
      <Why of={name} faults={faults} />
    </li>
  );
}

/** How many files there are, and what became of them. */
function summary(): string {
  const { ownCars: words } = text.value;
  const files = logFiles.value;
  const counted = (["read", "part", "out", "ignored"] as const).flatMap((state) => {
    const number = files.filter((file) => file.state === state).length;
    return number > 0 ? [`${format.value.figure(number, 0)} ${words.states[state]}`] : [];
  });
  return words.summary(files.length, counted.join(", "));
}

export function OwnCarFiles() {
  const { ownCars: words } = text.value;
  const [chosen, choose] = useState<Partial<Record<Group, boolean>>>({});
  const list = useRef<HTMLElement>(null);
  const files = logFiles.value;
  const { stage } = logs.value ?? {};
  const bad = unreadable.value;
  const way = files.filter(({ group }) => group === "way");
  const sent = way.filter(({ state }) => state === "sent").length;
  return (
    <>
      <p class="summary" role="status">
        {stage === "sending"
          ? words.sending(way.length)
          : stage === "reading"
            ? words.reading(files.length)
            : summary()}
      </p>
      {stage === "sending" && (
        <progress aria-label={words.sending(way.length)} value={sent} max={way.length} />
      )}
      <section class="files" ref={list} tabIndex={0} aria-label={words.files} aria-busy={stage !== "ready"}>
        {GROUPS.map((group) => {
          const its = files.filter((file) => file.group === group);
          const isOpen = chosen[group] ?? (group === "out" || group === "way" || its.length <= FEW);
          return (
            its.length > 0 && (
              <details
                key={group}
                open={isOpen}
                onToggle={({ currentTarget: { open } }) => {
                  if (open !== isOpen) choose({ ...chosen, [group]: open });
                }}
              >
                <summary>{words.groups[group](its.length)}</summary>
                {isOpen && (
                  <ul>
                    {its.map((file) => (
                      <Row key={file.key} of={file} />
                    ))}
                  </ul>
                )}
              </details>
            )
          );
        })}
      </section>
      {bad.length > 0 && stage !== "sending" && (
        <div class="actions start">
          <Button
            onClick={() => {
              list.current?.focus(); // the button goes
              void leaveOut(bad);
            }}
            label={words.leaveOutUnreadable(bad.length)}
          />
        </div>
      )}
    </>
  );
}
