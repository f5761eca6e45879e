import js from "@eslint/js";
import tseslint from "typescript-eslint";
import textRule from "./text-rule.mjs";

export default tseslint.config(
  {
    ignores: ["node_modules", "generated"],
  },
  js.configs.recommended,
  {
    files: ["src/**/*.ts", "src/**/*.tsx", "report/*.ts", "test/**/*.ts"],
    extends: [tseslint.configs.strict, tseslint.configs.stylistic],
    rules: { eqeqeq: ["error", "always", { null: "ignore" }] },
  },
  {
    files: ["src/**/*.ts", "src/**/*.tsx"],
    ignores: ["src/text/**"],
    plugins: { page: { rules: { text: textRule } } },
    rules: { "page/text": "error" },
  },
  {
    files: ["*.mjs", "test/*.mjs"],
    languageOptions: { globals: { Buffer: "readonly", process: "readonly" } },
  },
);
