/** Small parts that many cards and dialogs have. */

import type { Signal } from "@preact/signals";
import type { ButtonHTMLAttributes, ComponentChildren, TargetedSubmitEvent } from "preact";
import { type Inputs, useEffect, useRef, useState } from "preact/hooks";
import { Icon, type IconName } from "./icons";

/** A handler that puts what is chosen into a signal. */
export function into<T>(signal: Signal<T>): (value: T) => void {
  return (value) => {
    signal.value = value;
  };
}

/** A handler that puts one value into a signal. */
export function put<T>(signal: Signal<T>, value: T): () => void {
  return () => {
    signal.value = value;
  };
}

/** A handler of a form that the page reads itself. */
export function submitting(read: (form: HTMLFormElement) => void) {
  return (event: TargetedSubmitEvent<HTMLFormElement>) => {
    event.preventDefault();
    read(event.currentTarget);
  };
}

type ButtonProps = ButtonHTMLAttributes & { label: string; icon?: IconName };

/** A button with a text, which sends no form; an icon stands before it. */
export function Button({ label, icon, ...rest }: ButtonProps) {
  return (
    <button type="button" {...rest}>
      {icon && <Icon name={icon} />}
      {label}
    </button>
  );
}

/** The button that sends a form. */
export function Submit({ label, ...rest }: ButtonProps) {
  return (
    <button type="submit" class="primary" {...rest}>
      {label}
    </button>
  );
}

interface StatProps {
  label: string;
  class?: string;
  children: ComponentChildren;
}

/** A figure with its name, in a list of such. */
export function Stat({ label, class: kind = "", children }: StatProps) {
  return (
    <div>
      <dt>{label}</dt>
      <dd class={kind}>{children}</dd>
    </div>
  );
}

interface TickProps {
  label: string;
  checked: boolean;
  disabled?: boolean;
  onChange: (checked: boolean) => void;
}

/** A box to tick, with its label. */
export function Tick({ label, checked, disabled = false, onChange }: TickProps) {
  return (
    <label class="tick">
      <input
        type="checkbox"
        checked={checked}
        disabled={disabled}
        onChange={(event) => onChange(event.currentTarget.checked)}
      />
      {label}
    </label>
  );
}

/** A button that shows an icon alone. */
export function IconButton({ icon, label, ...rest }: ButtonProps & { icon: IconName }) {
  return (
    <button type="button" class="quiet" aria-label={label} title={label} {...rest}>
      <Icon name={icon} />
    </button>
  );
}

/** A row of a list to choose from: its name, and figures beside it. */
export function Row({ label, children, ...rest }: ButtonProps) {
  return (
    <li>
      <button type="button" {...rest}>
        <span class="name">{label}</span>
        <span class="figures">{children}</span>
      </button>
    </li>
  );
}

/** Details behind their title. */
export function Fold({ title, children }: { title: string; children: ComponentChildren }) {
  return (
    <details class="as-table">
      <summary>{title}</summary>
      {children}
    </details>
  );
}

/** The element of a dialog that is modal while it is open. */
export function useModal(isOpen: boolean) {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    if (isOpen) dialog.current?.showModal();
    else dialog.current?.close();
  }, [isOpen]);
  return dialog;
}

/** What is asked for; null until it is there, and where it fails. */
export function useAsked<T>(ask: () => Promise<T | null>, inputs: Inputs): T | null {
  const [given, setGiven] = useState<T | null>(null);
  useEffect(() => {
    let isLatest = true;
    void ask()
      .catch(() => null)
      .then((answer) => isLatest && setGiven(answer));
    return () => void (isLatest = false);
  }, inputs);
  return given;
}
