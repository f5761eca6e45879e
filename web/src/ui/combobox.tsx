import { useState } from "preact/hooks";

export interface Option {
  key: string;
  name: string;
  /** What stands behind the name, with the sign between them. */
  detail: string;
  take: () => void;
}

interface Props {
  id: string;
  /** Of the list. */
  label: string;
  value: string;
  placeholder: string;
  maxLength: number;
  isWrong: boolean;
  /** What there is to choose; the list is open while there is anything. */
  options: Option[];
  onType: (words: string) => void;
  /** Opens the list of a field in which nothing is typed. */
  onOpen?: () => void;
  onFocus: (input: HTMLInputElement) => void;
  onClose: () => void;
}

// eslint-disable-next-line page/text -- names of keys
const [ENTER, ESCAPE] = ["Enter", "Escape"];

/** A field with a list: arrow keys move, Enter takes, Escape closes. */
export function Combobox({ id, label, isWrong, options, onType, onOpen, onFocus, onClose, ...input }: Props) {
  const [active, setActive] = useState("");
  const isOpen = options.length > 0;
  // by its key: what was moved to stays active while the answer to the words comes in
  const found = options.findIndex(({ key }) => key === active);
  const now = Math.max(found, 0);
  const take = (option: Option | undefined) => {
    onClose();
    option?.take();
  };
  const move = (by: number) => {
    const to = (now + options.length + by) % options.length;
    setActive(options[to]?.key ?? "");
    document.getElementById(`${id}-${to}`)?.scrollIntoView({ block: "nearest" });
  };
  const press = (event: KeyboardEvent) => {
    if (!isOpen && onOpen && event.key === "ArrowDown") onOpen();
    else if (!isOpen) return;
    else if (event.key === "ArrowDown") move(1);
    else if (event.key === "ArrowUp") move(-1);
    else if (event.key === ENTER) take(options[now]);
    else if (event.key === ESCAPE) onClose();
    else return;
    event.preventDefault();
  };
  return (
    <>
      <input
        id={id}
        role="combobox"
        autocomplete="off"
        spellcheck={false}
        aria-expanded={isOpen}
        aria-controls={`${id}-list`}
        aria-autocomplete="list"
        aria-activedescendant={isOpen ? `${id}-${now}` : undefined}
        aria-invalid={isWrong}
        onFocus={(event) => onFocus(event.currentTarget)}
        onClick={() => !isOpen && onOpen?.()}
        onInput={(event) => {
          setActive("");
          onType(event.currentTarget.value);
        }}
        onKeyDown={press}
        onBlur={onClose}
        title={input.value}
        {...input}
      />
      <ul id={`${id}-list`} role="listbox" aria-label={label} hidden={!isOpen}>
        {options.map((option, k) => (
          <li
            key={option.key}
            id={`${id}-${k}`}
            role="option"
            aria-selected={k === now}
            onMouseDown={(event) => {
              event.preventDefault();
              take(option);
            }}
          >
            {option.name}
            {option.detail && <span class="kind">{option.detail}</span>}
          </li>
        ))}
      </ul>
    </>
  );
}
