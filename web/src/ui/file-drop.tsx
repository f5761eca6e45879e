import type { ComponentChildren } from "preact";
import { useRef, useState } from "preact/hooks";
import { text } from "../state/preferences";
import { Icon } from "./icons";
import { Button } from "./parts";

interface Props {
  label: string;
  formats: string;
  /** Endings of names, for the dialog of the browser and for the files of a folder. */
  accept: string;
  /** Several files, and folders with all that is in them. */
  multiple?: boolean;
  /** A larger file is refused. */
  mostBytes?: number;
  onFiles: (files: File[]) => void;
  children?: ComponentChildren;
}

const MEGABYTE = 1_000_000;
const HAS_FOLDERS = "webkitdirectory" in HTMLInputElement.prototype;

/** Files of a folder and of the folders in it; those that cannot be opened are skipped. */
async function filesIn(entry: FileSystemEntry): Promise<File[]> {
  if (entry.isFile) {
    const file = entry as FileSystemFileEntry;
    return new Promise((resolve) =>
      file.file(
        (found) => resolve([found]),
        () => resolve([]),
      ),
    );
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  const files: File[] = [];
  for (;;) {
    const part = await new Promise<FileSystemEntry[]>((resolve) =>
      reader.readEntries(resolve, () => resolve([])),
    );
    if (part.length === 0) return files;
    for (const inside of part) files.push(...(await filesIn(inside)));
  }
}

/** A place to choose files or to drop them. */
export function FileDrop({ label, formats, accept, multiple = false, mostBytes, onFiles, children }: Props) {
  const [over, setOver] = useState(false);
  const [refused, setRefused] = useState("");
  const folder = useRef<HTMLInputElement>(null);
  const { trip: words } = text.value;
  const take = (files: readonly File[], isEmptyFolder = false) => {
    const large = files.find(({ size }) => mostBytes !== undefined && size > mostBytes);
    const fitting = files.filter(({ size }) => mostBytes === undefined || size <= mostBytes);
    if (large) setRefused(words.tooLarge(large.name, (mostBytes ?? 0) / MEGABYTE));
    else setRefused(isEmptyFolder && files.length === 0 ? words.emptyFolder : "");
    if (fitting.length > 0) onFiles(fitting);
  };
  /** Files of a folder that have one of the endings; hidden ones are those of systems. */
  const ofFolder = (files: readonly File[]) =>
    files.filter(({ name }) => {
      const isHidden = name.startsWith(".") || name.startsWith("~");
      return !isHidden && accept.split(",").some((ending) => name.toLowerCase().endsWith(ending));
    });
  const drop = async (items: DataTransferItemList | undefined, files: readonly File[]) => {
    const entries = [...(items ?? [])].map((item) => item.webkitGetAsEntry());
    const folders = multiple ? entries.filter((entry) => entry?.isDirectory) : [];
    if (folders.length === 0) return take(files);
    const single = files.filter((_, k) => !entries[k]?.isDirectory);
    const inside = await Promise.all(folders.map((entry) => filesIn(entry as FileSystemEntry)));
    take([...single, ...ofFolder(inside.flat())], true);
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
        void drop(event.dataTransfer?.items, [...(event.dataTransfer?.files ?? [])]);
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
            take([...(event.currentTarget.files ?? [])]);
            event.currentTarget.value = "";
          }}
        />
      </label>
      {multiple && HAS_FOLDERS && (
        <div class="actions start">
          <Button onClick={() => folder.current?.click()} label={words.chooseFolder} />
          <input
            ref={folder}
            type="file"
            hidden
            {...{ webkitdirectory: true }}
            onChange={(event) => {
              take(ofFolder([...(event.currentTarget.files ?? [])]), true);
              event.currentTarget.value = "";
            }}
          />
        </div>
      )}
      {refused && (
        <p class="faults" role="alert">
          {refused}
        </p>
      )}
      {children}
    </div>
  );
}
