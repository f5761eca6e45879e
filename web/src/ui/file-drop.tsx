import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { text } from "../state/preferences";
import { Icon } from "./icons";

interface Props {
  label: string;
  formats: string;
  /** Endings of names, for the dialog of the browser. */
  accept: string;
  multiple?: boolean;
  /** A larger file is refused. */
  mostBytes: number;
  onFiles: (files: File[]) => void;
  children?: ComponentChildren;
}

const MEGABYTE = 1_000_000;

/** A place to choose files or to drop them. */
export function FileDrop({ label, formats, accept, multiple = false, mostBytes, onFiles, children }: Props) {
  const [over, setOver] = useState(false);
  const [refused, setRefused] = useState("");
  const take = (list: FileList | null | undefined) => {
    const files = [...(list ?? [])];
    const large = files.find(({ size }) => size > mostBytes);
    setRefused(large ? text.value.trip.tooLarge(large.name, mostBytes / MEGABYTE) : "");
    const fitting = files.filter(({ size }) => size <= mostBytes);
    if (fitting.length > 0) onFiles(fitting);
  };
  return (
    <div
      class={`drop${over ? " over" : ""}`}
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => setOver(false)}
      onDrop={(event) => {
        event.preventDefault();
        setOver(false);
        take(event.dataTransfer?.files);
      }}
    >
      <label class="file">
        <Icon name="upload" />
        <span class="name">{label}</span>
        <span class="figures">{formats}</span>
        <input
          type="file"
          multiple={multiple}
          accept={accept}
          onChange={(event) => {
            take(event.currentTarget.files);
            event.currentTarget.value = "";
          }}
        />
      </label>
      {refused && <p class="faults">{refused}</p>}
      {children}
    </div>
  );
}
