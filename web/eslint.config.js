import eslint from "@eslint/js";
import { defineConfig } from "eslint/config";
import tseslint from "typescript-eslint";

export default defineConfig(
  { ignores: ["node_modules"] },
  eslint.configs.recommended,
  {
    files: ["**/*.ts"],
    extends: [tseslint.configs.strictTypeChecked],
    languageOptions: { parserOptions: { projectService: true } },
    rules: {
      // Numbers are what this project puts into text.
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }],
      // Places of typed arrays are computed, and known to be there.
      "@typescript-eslint/no-non-null-assertion": "off",
    },
  },
);
