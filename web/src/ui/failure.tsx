import type { Fault, Problem } from "../api/documents";
import { FAILED, UNREACHABLE } from "../api/client";
import { loading, passBy, retry, source } from "../state/catalogue";
import { PAGE_ERROR, problem } from "../state/forecast";
import { vias } from "../state/journey";
import { type Said, said } from "../state/messages";
import { text } from "../state/preferences";
import { trip } from "../state/trip";
import { FaultList } from "./faults";
import { Icon } from "./icons";
import { Button } from "./parts";

/** Code of the fault of a station that was chosen. */
const UNFIT = "no-charging-station-for-this-car";

/** Title and detail of a problem. */
function problemText({ type, title, status, detail: given }: Problem): { title: string; detail: Said } {
  const { problems } = text.value;
  const detail = said(given ?? "");
  if (type === UNREACHABLE) return { title: problems.unreachable, detail: own(problems.unreachableHint) };
  if (type === PAGE_ERROR) return { title: problems.page, detail };
  if (type === FAILED) return { title: problems.titles.internal, detail: own(problems.status(status)) };
  const titles: Record<string, string> = problems.titles;
  return { title: titles[type?.split("/").at(-1) ?? ""] ?? title, detail };
}

function own(words: string): Said {
  return { text: words, lang: undefined };
}

export function Failure() {
  const failure = problem.value;
  if (!failure) return null;
  const { problems } = text.value;
  const { title, detail } = problemText(failure);
  const isUnfit = ({ code, where }: Fault) => code === UNFIT && vias.value.some((one) => one?.name === where);
  const unfit = failure.faults?.find(isUnfit)?.where;
  const list = failure.faults?.length ? <FaultList faults={failure.faults} /> : null;
  const avoid = () => vias.value.forEach((one) => one && one.name === unfit && passBy(one));
  const label = unfit ? text.value.map.passBy : list ? text.value.close : problems.retry;
  return (
    <div class="failure" role="alert">
      <Icon name="warning" />
      <div>
        <strong>{unfit ? problems.unfit(unfit) : title}</strong>
        {!unfit && (list ?? <p lang={detail.lang}>{detail.text}</p>)}
      </div>
      <Button onClick={unfit ? avoid : retry} label={label} />
    </div>
  );
}

/** While nothing is shown: what to do for a first answer, or that it is on its way. */
export function Waiting() {
  const { result } = text.value;
  return loading.value === null && !trip.value ? (
    <div class="empty">
      <Icon name="road" />
      <p>
        <strong>{result.noTrip}</strong> {result.hints[source.value]}
      </p>
    </div>
  ) : (
    <div class="skeleton" aria-hidden="true">
      <span />
      <span />
    </div>
  );
}
