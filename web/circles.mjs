/** Circles of imports between the modules of a folder; type imports count too. */

import { readdir, readFile } from "node:fs/promises";
import { dirname, join, relative, resolve, sep } from "node:path";
import ts from "typescript";

const MODULE = /\.tsx?$/;

/** The modules that each module of a folder imports; names are relative to the folder, without their ending. */
export async function importsIn(folder) {
  const entries = await readdir(folder, { recursive: true, withFileTypes: true });
  const files = entries.filter((entry) => entry.isFile() && MODULE.test(entry.name));
  const nameOf = (path) => relative(folder, path).split(sep).join("/").replace(MODULE, "");
  const paths = new Map(
    files
      .map((entry) => join(entry.parentPath ?? entry.path, entry.name))
      .map((path) => [nameOf(path), path]),
  );
  const imports = new Map();
  for (const [name, path] of paths) {
    const { importedFiles } = ts.preProcessFile(await readFile(path, "utf8"));
    const named = importedFiles
      .filter(({ fileName }) => fileName.startsWith("."))
      .map(({ fileName }) => nameOf(resolve(dirname(path), fileName)))
      .map((target) => (paths.has(target) ? target : `${target}/index`));
    imports.set(
      name,
      named.filter((target) => paths.has(target)),
    );
  }
  return imports;
}

/** Each circle as the list of its modules; the first module stands at the end again. */
export function circles(imports) {
  const found = [];
  const done = new Set();
  const visit = (name, path) => {
    if (path.includes(name)) {
      found.push([...path.slice(path.indexOf(name)), name]);
      return;
    }
    if (done.has(name)) return;
    for (const next of imports.get(name) ?? []) visit(next, [...path, name]);
    done.add(name);
  };
  for (const name of imports.keys()) visit(name, []);
  return found;
}
