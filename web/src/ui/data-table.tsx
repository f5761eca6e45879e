import type { ComponentChildren } from "preact";

interface Props {
  /** Of the section, for assistive tools. */
  label: string;
  class?: string;
  caption?: string;
  /** Empty for a column without a head. */
  heads: string[];
  /** Rows of cells, or whole rows. */
  children: ComponentChildren;
}

/** A table with a head in a part of the page that scrolls. */
export function DataTable({ label, class: kind = "", caption, heads, children }: Props) {
  return (
    <section class="scroll" tabIndex={0} aria-label={label}>
      <table class={kind}>
        {caption && <caption>{caption}</caption>}
        <thead>
          <tr>
            {heads.map((head) => (head ? <th key={head} scope="col" children={head} /> : <td key={head} />))}
          </tr>
        </thead>
        <tbody>{children}</tbody>
      </table>
    </section>
  );
}
