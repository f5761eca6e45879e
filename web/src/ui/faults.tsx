import type { Fault } from "../api/documents";
import { placeText, said } from "../state/messages";
import { text } from "../state/preferences";
import { Said } from "./said";

const MAX_LISTED = 6;

/** Faults of an input, in the language of the page. */
export function FaultList({ id, faults }: { id?: string; faults: Fault[] }) {
  if (faults.length === 0) return null;
  const { problems } = text.value;
  return (
    <ul class="faults" id={id}>
      {faults.slice(0, MAX_LISTED).map((fault) => (
        <li key={`${fault.where} ${fault.what}`}>
          <strong>
            <Said of={fault.what} />
          </strong>
          {fault.where && problems.at(placeText(fault.where))}
          {fault.got && `: ${said(fault.got).text}`}
          {fault.allowed && !fault.what.endsWith(fault.allowed) && problems.allowed(said(fault.allowed).text)}
          {fault.fix && ". "}
          {fault.fix && <Said of={fault.fix} />}
        </li>
      ))}
      {faults.length > MAX_LISTED && <li>{problems.more(faults.length - MAX_LISTED)}</li>}
    </ul>
  );
}
