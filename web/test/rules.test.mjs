/** The rule against text in the code, and no circles between the modules. */

import assert from "node:assert/strict";
import { dirname, join } from "node:path";
import { describe, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { RuleTester } from "eslint";
import textRule from "../text-rule.mjs";

const WEB = join(dirname(fileURLToPath(import.meta.url)), "..");

RuleTester.describe = describe;
RuleTester.it = test;

const tester = new RuleTester({
  languageOptions: { parserOptions: { ecmaFeatures: { jsx: true } } },
});

tester.run("text", textRule, {
  valid: [
    'import { a } from "some module";',
    'const type = "application/json";',
    'const key = "motor_power_limit";',
    "const x = <p class={`card main ${kind}`}>{text.title}</p>;",
    'const x = <svg d="M4 22c5-1 6-12" />;',
    "const x = <span> · 80 %</span>;",
  ],
  invalid: [
    { code: "const x = <p>Close</p>;", errors: 1 },
    { code: "const x = <p>of</p>;", errors: 1 },
    { code: 'const x = <Slider label="load" />;', errors: 1 },
    { code: 'const x = <p aria-label={`from ${a}`}>{b ? "Reset" : c}</p>;', errors: 2 },
    { code: 'const title = "No trip yet";', errors: 1 },
    { code: "const said = `${low} to ${high} trips`;", errors: 2 },
    { code: 'const shown = wrong ? "Try again" : "";', errors: 1 },
  ],
});

test("no circle of imports", async () => {
  const { metafile } = await build({
    absWorkingDir: WEB,
    entryPoints: ["src/main.tsx"],
    bundle: true,
    write: false,
    outdir: "unused",
    metafile: true,
    jsx: "automatic",
    jsxImportSource: "preact",
    loader: { ".woff2": "empty" },
  });
  const done = new Set();
  const visit = (name, path) => {
    assert.ok(!path.includes(name), [...path.slice(path.indexOf(name)), name].join(" -> "));
    if (done.has(name)) return;
    for (const { path: next } of metafile.inputs[name].imports) {
      if (next.startsWith("src/")) visit(next, [...path, name]);
    }
    done.add(name);
  };
  visit("src/main.tsx", []);
  assert.ok(done.size > 30, `${done.size} modules`);
});
