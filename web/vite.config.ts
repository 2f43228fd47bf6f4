import { readFileSync } from "node:fs";
import { defineConfig } from "vite";

// Its terms ask that copies hold them, and a built module is a copy.
const licence = readFileSync("node_modules/three/LICENSE", "utf8").trim();

/**
 * One build makes one module with everything in it, so that a page needs one file and no other:
 * `vite build --mode NAME` makes NAME.js from src/NAME.ts.
 */
export default defineConfig(({ mode }) => ({
  publicDir: false,
  build: {
    outDir: "../src/pianomime/replay/page",
    emptyOutDir: false,
    target: "es2022",
    modulePreload: false,
    lib: { entry: `src/${mode}.ts`, formats: ["es"], fileName: () => `${mode}.js` },
    rolldownOptions: {
      output: {
        banner: `/*! This module contains three.js.\n\n${licence}\n*/`,
        minify: true,
        comments: { legal: true, annotation: false, jsdoc: false },
      },
    },
  },
}));
