import type { Fault } from "../api/types";
import { text } from "../state/preferences";

const MOST = 6;

/** Faults of an input, beside it. The service words them in English. */
export function FaultList({ id, faults }: { id?: string; faults: Fault[] }) {
  if (faults.length === 0) return null;
  const { problems } = text.value;
  return (
    <ul class="faults" id={id}>
      {faults.slice(0, MOST).map((fault) => (
        <li key={`${fault.where} ${fault.what}`}>
          <strong lang="en">{fault.what}</strong>
          {fault.where && problems.at(fault.where)}
          {fault.got && `: ${fault.got}`}
          {fault.allowed && problems.allowed(fault.allowed)}
          {fault.fix && <span lang="en">{`. ${fault.fix}`}</span>}
        </li>
      ))}
      {faults.length > MOST && <li>{problems.more(faults.length - MOST)}</li>}
    </ul>
  );
}
