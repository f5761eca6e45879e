/** The modules of the page import each other without circles. */

import assert from "node:assert/strict";
import { dirname, join } from "node:path";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import { circles, importsIn } from "../circles.mjs";

const SOURCES = join(dirname(fileURLToPath(import.meta.url)), "..", "src");

test("no circle of imports", async () => {
  const imports = await importsIn(SOURCES);
  assert.ok(imports.size > 50, `${imports.size} modules`);
  assert.ok(imports.get("ui/result").includes("ui/compare"));
  assert.ok(imports.get("state/preferences").includes("text/index"));
  assert.deepEqual(circles(imports), []);
});

test("a circle is found with its path", () => {
  const imports = new Map([
    ["main", ["a"]],
    ["a", ["b"]],
    ["b", ["c", "d"]],
    ["c", []],
    ["d", ["a"]],
  ]);
  assert.deepEqual(circles(imports), [["a", "b", "d", "a"]]);
});
