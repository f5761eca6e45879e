import { useId, useState } from "preact/hooks";
import { EMPTY_ROW, type LinkRow, linksOfRows, SAMPLE_ROWS, SAMPLE_START_M } from "../model/link-rows";
import { chooseRoute } from "../state/catalogue";
import { text, units } from "../state/preferences";
import { DataTable } from "./data-table";
import { NumberField } from "./number-field";
import { Button, Fold, IconButton, Submit, submitting } from "./parts";

const START_ROWS = 3;
const LINKS_HINT = '[{"length_m": 1800, "speed_m_s": 8.5}, …]';

/** Links of a planned route as a table, or a text with links or the response of a router. */
export function LinksForm() {
  const [rows, setRows] = useState<LinkRow[]>(Array.from({ length: START_ROWS }, () => EMPTY_ROW));
  const [startM, setStart] = useState<number | null>(null);
  const [pasted, setPasted] = useState("");
  const id = useId();
  const { linksForm: words } = text.value;
  const { distance, speed, height } = units.value;
  const columns = [
    { name: "lengthM", label: words.length, quantity: distance, digits: 3 },
    { name: "speedMS", label: words.speed, quantity: speed, digits: 1 },
    { name: "heightM", label: words.height, quantity: height, digits: 0 },
  ] as const;
  const change = (at: number, some: Partial<LinkRow>) =>
    setRows(rows.map((row, k) => (k === at ? { ...row, ...some } : row)));
  const use = (links: object) => void chooseRoute(JSON.stringify(links), "", "links", 0);
  const isEmpty = linksOfRows(rows, startM).length === 0;
  return (
    <>
      <form
        class="links"
        onSubmit={submitting(() => {
          if (!isEmpty) return use(linksOfRows(rows, startM));
          setRows(SAMPLE_ROWS);
          setStart(SAMPLE_START_M);
          use(linksOfRows(SAMPLE_ROWS, SAMPLE_START_M));
        })}
      >
        <div class="inline">
          <NumberField label={words.start} value={startM} quantity={height} onChange={setStart} />
        </div>
        <DataTable
          label={words.caption}
          heads={[distance.unit, speed.unit, text.value.tables.elevationIn(height.unit), ""]}
        >
          {rows.map((row, k) => (
            <tr key={k}>
              {columns.map(({ name, label, quantity, digits }) => (
                <td key={name}>
                  <NumberField
                    isInTable
                    label={label(k + 1)}
                    value={row[name]}
                    quantity={quantity}
                    digits={digits}
                    onChange={(si) => change(k, { [name]: si })}
                  />
                </td>
              ))}
              <td>
                <IconButton
                  icon="close"
                  label={words.remove(k + 1)}
                  onClick={() => setRows(rows.filter((_, other) => other !== k))}
                />
              </td>
            </tr>
          ))}
        </DataTable>
        <Button onClick={() => setRows([...rows, EMPTY_ROW])} label={words.add} />
        <Submit label={isEmpty ? words.example : words.use} />
      </form>
      <Fold title={words.paste}>
        <form class="links" onSubmit={submitting(() => void chooseRoute(pasted, "", "links", 0))}>
          <label for={id}>{words.json}</label>
          <textarea
            id={id}
            rows={5}
            spellcheck={false}
            value={pasted}
            placeholder={LINKS_HINT}
            onInput={(event) => setPasted(event.currentTarget.value)}
          />
          <Submit label={words.useJson} disabled={!pasted.trim()} />
        </form>
      </Fold>
    </>
  );
}
