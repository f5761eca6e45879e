import js from "@eslint/js";
import tseslint from "typescript-eslint";

export default tseslint.config(
  { ignores: ["node_modules"] },
  js.configs.recommended,
  {
    files: ["src/**/*.ts", "src/**/*.tsx"],
    extends: [tseslint.configs.strict, tseslint.configs.stylistic],
    rules: { eqeqeq: ["error", "always", { null: "ignore" }] },
  },
  { files: ["*.mjs"], languageOptions: { globals: { Buffer: "readonly", process: "readonly" } } },
);
