import type { Fault } from "../api/types";

const MOST = 6;

/** What the service says is wrong, where it is wrong. */
export function FaultList({ id, faults }: { id?: string; faults: Fault[] }) {
  if (faults.length === 0) return null;
  return (
    <ul class="faults" id={id}>
      {faults.slice(0, MOST).map((fault) => (
        <li key={`${fault.where} ${fault.what}`}>
          <strong>{fault.what}</strong>
          {fault.where && ` at ${fault.where}`}
          {fault.got && `: ${fault.got}`}
          {fault.allowed && ` (allowed: ${fault.allowed})`}
          {fault.fix && `. ${fault.fix}`}
        </li>
      ))}
      {faults.length > MOST && <li>and {faults.length - MOST} more</li>}
    </ul>
  );
}
