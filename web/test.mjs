/** Runs the tests in `test/` with Node's own runner; those in TypeScript are bundled into a temporary folder first. */

import { spawnSync } from "node:child_process";
import { mkdtemp, readdir, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const HERE = dirname(fileURLToPath(import.meta.url));
const TESTS = join(HERE, "test");

const names = await readdir(TESTS);
const outdir = await mkdtemp(join(tmpdir(), "page-tests-"));
try {
  await build({
    absWorkingDir: HERE,
    entryPoints: names.filter((name) => name.endsWith(".test.ts")).map((name) => join(TESTS, name)),
    outdir,
    outExtension: { ".js": ".mjs" },
    bundle: true,
    platform: "node",
    format: "esm",
    sourcemap: "inline",
  });
  const bundled = (await readdir(outdir)).map((name) => join(outdir, name));
  const own = names.filter((name) => name.endsWith(".test.mjs")).map((name) => join(TESTS, name));
  const command = ["--enable-source-maps", "--test", "--test-reporter=spec", ...bundled, ...own];
  const { status } = spawnSync(process.execPath, command, { cwd: HERE, stdio: "inherit" });
  process.exitCode = status ?? 1;
} finally {
  await rm(outdir, { recursive: true, force: true });
}
