/**
 * Writes `src/api/types.ts` from the service's OpenAPI document, which comes from standard input: `make types` in the
 * folder above.
 */

import { writeFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { text } from "node:stream/consumers";
import { fileURLToPath } from "node:url";
import openapiTS, { astToString } from "openapi-typescript";

const HERE = dirname(fileURLToPath(import.meta.url));
const OUT = process.argv[2] ?? join(HERE, "src", "api", "types.ts");
const HEAD =
  "/** Documents of the service, written by `types.mjs` from its OpenAPI document. Do not edit. */\n\n";

/** A part of the document without texts, examples and problems, and without "one of two fields", which the service checks. */
function slim(node, key = "") {
  if (Array.isArray(node)) return node.map((part) => slim(part));
  if (node === null || typeof node !== "object") return node;
  const entries = Object.entries(node);
  if (key === "properties" || key === "schemas") {
    return Object.fromEntries(entries.map(([name, part]) => [name, slim(part)]));
  }
  const left = new Set([
    "title",
    "description",
    "summary",
    "example",
    "examples",
    "default",
    ...(node.properties ? ["oneOf"] : []),
  ]);
  return Object.fromEntries(
    entries
      .filter(([name]) => !left.has(name) && !(key === "responses" && name !== "200"))
      .map(([name, part]) => [name, slim(part, name)]),
  );
}

const { paths, components, ...rest } = JSON.parse(await text(process.stdin));
const types = await openapiTS(slim({ ...rest, paths, components }), {
  defaultNonNullable: false,
  emptyObjectsUnknown: true,
  rootTypes: true,
  rootTypesNoSchemaPrefix: true,
});
await writeFile(OUT, HEAD + astToString(types));
