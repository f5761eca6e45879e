/** The rule against text in the code. */

import { describe, test } from "node:test";
import { RuleTester } from "eslint";
import textRule from "../text-rule.mjs";

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
    { code: "const words = `${low} to ${high} trips`;", errors: 2 },
    { code: 'const shown = wrong ? "Try again" : "";', errors: 1 },
  ],
});
