import type { Fault } from "../api/documents";
import { text } from "../state/preferences";

const MAX_LISTED = 6;

/** Faults of an input; their texts are those of the service, in English. */
export function FaultList({ id, faults }: { id?: string; faults: Fault[] }) {
  if (faults.length === 0) return null;
  const { problems } = text.value;
  return (
    <ul class="faults" id={id}>
      {faults.slice(0, MAX_LISTED).map((fault) => (
        <li key={`${fault.where} ${fault.what}`}>
          <strong lang="en">{fault.what}</strong>
          {fault.where && problems.at(fault.where)}
          {fault.got && `: ${fault.got}`}
          {fault.allowed && problems.allowed(fault.allowed)}
          {fault.fix && <span lang="en">{`. ${fault.fix}`}</span>}
        </li>
      ))}
      {faults.length > MAX_LISTED && <li>{problems.more(faults.length - MAX_LISTED)}</li>}
    </ul>
  );
}
