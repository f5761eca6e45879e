/**
 * Writes `types.ts` and `fields.ts` into `generated` from the service's OpenAPI document, which comes from standard input:
 * `make types` in the folder above.
 */

import { mkdir, writeFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { text } from "node:stream/consumers";
import { fileURLToPath } from "node:url";
import openapiTS, { astToString } from "openapi-typescript";

const HERE = dirname(fileURLToPath(import.meta.url));
const OUT = join(HERE, "generated");
const WRITTEN = "written by `types.mjs` from the OpenAPI document of the service. Do not edit. */\n\n";

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

/** What a form needs of a field of the departure: unit and bounds of a number, or choices. */
function fieldOf({ anyOf, ...more }) {
  const given = anyOf.find(({ type }) => type !== "null");
  if (given.type === "array") return { choices: given.items.enum, several: true };
  if (given.enum) return { choices: given.enum };
  return { unit: more["x-unit"], minimum: given.minimum, maximum: given.maximum };
}

const document = JSON.parse(await text(process.stdin));
const types = await openapiTS(slim(document), {
  defaultNonNullable: false,
  emptyObjectsUnknown: true,
  rootTypes: true,
  rootTypesNoSchemaPrefix: true,
});
const { properties } = document.components.schemas.ForecastRequest;
const fields = Object.entries(properties)
  .filter(([, schema]) => schema["x-label"] && schema.anyOf[0].type !== "object" && !schema.anyOf[0].format)
  .map(([name, schema]) => `  ${name}: ${JSON.stringify(fieldOf(schema))},\n`);
await mkdir(OUT, { recursive: true });
await writeFile(join(OUT, "types.ts"), `/** Documents of the service, ${WRITTEN}${astToString(types)}`);
await writeFile(
  join(OUT, "fields.ts"),
  `/** The fields of a departure, ${WRITTEN}export const FIELDS = {\n${fields.join("")}} as const;\n`,
);
