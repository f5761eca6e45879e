import { useId, useState } from "preact/hooks";
import { linksOf, SAMPLE } from "../model/sections";
import { chooseRoute } from "../state/catalogue";
import { text, units } from "../state/preferences";
import { Submit, submitting } from "./parts";

/** Sections of a planned road, one a line, or as JSON: links, or the answer of a router. */
export function LinksForm() {
  const [typed, setTyped] = useState("");
  const id = useId();
  const { linksForm: words } = text.value;
  const { distance, speed, height } = units.value;
  const use = () => {
    const given = typed.trim() || SAMPLE;
    setTyped(given);
    const links = /^[[{]/.test(given) ? given : JSON.stringify(linksOf(given, units.value));
    void chooseRoute(links, "", "links", 0);
  };
  return (
    <form class="links" onSubmit={submitting(use)}>
      <label for={id}>{words.given(distance.unit, speed.unit, height.unit)}</label>
      <textarea
        id={id}
        rows={7}
        spellcheck={false}
        value={typed}
        placeholder={SAMPLE}
        onInput={(event) => setTyped(event.currentTarget.value)}
      />
      <Submit label={typed.trim() ? words.use : words.example} />
    </form>
  );
}
