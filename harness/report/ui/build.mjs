// Bundles src/main.ts to one classic script, so that it runs from file://. Reproducible: the same
// sources and the locked esbuild give the same bytes. `--out FILE` writes elsewhere.
import { build } from "esbuild";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const at = process.argv.indexOf("--out");
await build({
  entryPoints: [join(here, "src/main.ts")],
  outfile: at < 0 ? join(here, "../assets/report.js") : process.argv[at + 1],
  absWorkingDir: here,
  bundle: true,
  format: "iife",
  target: "es2022",
  minify: true,
  legalComments: "none",
  banner: { js: "// Built from harness/report/ui by `make ui`; edit the sources there." },
  charset: "utf8",
});
