/** Builds the page with a record of what it was built from: into the Python package, or into a folder that is given. */

import { createHash } from "node:crypto";
import { cp, mkdir, readdir, readFile, rm, writeFile } from "node:fs/promises";
import { basename, dirname, join, relative, sep } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const HERE = dirname(fileURLToPath(import.meta.url));
const OUT = process.argv[2] ?? join(HERE, "..", "src", "tripwatt", "server", "http", "page");
const SOURCES = [
  "build.mjs",
  "icon.svg",
  "index.html",
  "package-lock.json",
  "package.json",
  "report",
  "src",
  "tsconfig.json",
];
const SHIPPED = [
  "preact",
  "@preact/signals",
  "@preact/signals-core",
  "uplot",
  "@fontsource-variable/inter",
  "maplibre-gl",
  "uqr",
];
/** What the report of a fleet contains, which is one file with its script and licences. */
const REPORT = process.argv[3] ?? join(HERE, "..", "src", "tripwatt", "study", "report", "templates");
const IN_REPORT = ["datatables.net", "uplot"];
const TARGET = ["es2022", "chrome111", "firefox113", "safari16.4"];

async function filesOf(path) {
  const entries = await readdir(path, { withFileTypes: true }).catch(() => null);
  if (entries === null) return [path];
  const found = await Promise.all(entries.map((entry) => filesOf(join(path, entry.name))));
  return found.flat();
}

/** SHA-256 over name and bytes of every source, in the order of names; tests/server/page computes the same. */
async function digestOfSources() {
  const files = (await Promise.all(SOURCES.map((name) => filesOf(join(HERE, name))))).flat();
  const named = files.map((path) => [relative(HERE, path).split(sep).join("/"), path]);
  named.sort(([a], [b]) => (a < b ? -1 : 1));
  const hash = createHash("sha256");
  for (const [name, path] of named) {
    const bytes = await readFile(path);
    hash.update(`${name}\n${bytes.length}\n`).update(bytes);
  }
  return hash.digest("hex");
}

/** The texts by language. */
async function catalogues() {
  const { outputFiles } = await build({
    absWorkingDir: HERE,
    entryPoints: ["src/text/index.ts"],
    bundle: true,
    format: "esm",
    write: false,
  });
  const module = `data:text/javascript;base64,${Buffer.from(outputFiles[0].contents).toString("base64")}`;
  const { LANGUAGES, load } = await import(module);
  const found = await Promise.all(Object.keys(LANGUAGES).map(load));
  return Object.fromEntries(found.map(({ language, text }) => [language, text]));
}

function escaped(text) {
  return text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll('"', "&quot;");
}

/** The page with its text, and with the names of what was built. */
async function pageOf(outputs) {
  const built = Object.keys(outputs).map((path) => basename(path));
  const texts = await catalogues();
  const inAll = Object.entries(texts).map(
    ([language, { document }]) => `<p lang="${language}">${escaped(document.noScript)}</p>`,
  );
  const { title, description } = texts.en.document;
  let page = (await readFile(join(HERE, "index.html"), "utf8"))
    .replace("{{title}}", escaped(title))
    .replace("{{description}}", escaped(description))
    .replace("{{noScript}}", inAll.join(""));
  for (const ending of ["css", "js"]) {
    const name = built.find((file) => file.startsWith("page-") && file.endsWith(`.${ending}`));
    page = page.replace(`"page.${ending}"`, `"assets/${name}"`);
  }
  // the parts that the script shares with those that are loaded later
  const { imports } = Object.values(outputs).find(({ entryPoint }) => entryPoint === "src/main.tsx");
  const shared = imports.filter(({ kind }) => kind === "import-statement").map(({ path }) => basename(path));
  const preloads = shared.map((name) => `<link rel="modulepreload" href="assets/${name}" />`);
  page = page.replace("</head>", `${preloads.join("\n    ")}\n  </head>`);
  return page;
}

async function packageOf(name) {
  return JSON.parse(await readFile(join(HERE, "node_modules", name, "package.json"), "utf8"));
}

/** MapLibre's file contains its dependencies. */
async function partsOfMap() {
  const { dependencies } = await packageOf("maplibre-gl");
  return Object.keys(dependencies).filter((name) => !name.startsWith("@types/"));
}

async function licences(names) {
  const texts = [];
  for (const name of names) {
    const { version, license } = await packageOf(name);
    const folder = join(HERE, "node_modules", name);
    const file = (await readdir(folder)).find((entry) => /^licen[cs]e/i.test(entry));
    const text = file
      ? await readFile(join(folder, file), "utf8")
      : "The package has no file with its licence.";
    texts.push(`${name} ${version} (${license.replace(/[()]/g, "")})\n\n${text.trim()}\n`);
  }
  return texts.join(`\n${"-".repeat(80)}\n\n`);
}

/** Leaves out what a first visit does not need: names of children, which are shorter as arguments, and styles of legends of uPlot. */
const shorter = {
  name: "shorter",
  setup(bundler) {
    bundler.onLoad({ filter: /uPlot\.min\.css$/ }, async ({ path }) => ({
      contents: (await readFile(path, "utf8")).replaceAll(
        /[^{}]*\.u-(?:legend|inline|series)[^{}]*\{[^{}]*\}/g,
        "",
      ),
      loader: "css",
    }));
    bundler.onLoad({ filter: /\.tsx$/ }, async ({ path }) => ({
      contents: `import { h, Fragment } from "preact";${await readFile(path, "utf8")}`,
      loader: "tsx",
    }));
  },
};

await rm(OUT, { recursive: true, force: true });
await mkdir(OUT, { recursive: true });
// The worker of the map is a file of its own, because the content security policy allows no worker from a text.
const worker = await build({
  absWorkingDir: HERE,
  entryPoints: { "map-worker": "node_modules/maplibre-gl/dist/maplibre-gl-worker.mjs" },
  entryNames: "assets/[name]-[hash]",
  outdir: OUT,
  bundle: true,
  minify: true,
  format: "esm",
  target: TARGET,
  metafile: true,
  legalComments: "none",
});
const [workerName] = Object.keys(worker.metafile.outputs).map((path) => basename(path));
const { metafile } = await build({
  absWorkingDir: HERE,
  entryPoints: { page: "src/main.tsx" },
  entryNames: "assets/[name]-[hash]",
  outdir: OUT,
  bundle: true,
  minify: true,
  format: "esm",
  target: TARGET,
  splitting: true,
  chunkNames: "assets/[name]-[hash]",
  define: { MAP_WORKER: JSON.stringify(workerName) },
  charset: "utf8",
  plugins: [shorter],
  tsconfigRaw: { compilerOptions: { jsx: "react", jsxFactory: "h", jsxFragmentFactory: "Fragment" } },
  loader: { ".woff2": "file" },
  assetNames: "assets/[name]-[hash]",
  metafile: true,
  legalComments: "none",
});
await cp(join(HERE, "icon.svg"), join(OUT, "icon.svg"));
await writeFile(join(OUT, "index.html"), await pageOf(metafile.outputs));
await writeFile(join(OUT, "licences.txt"), await licences([...SHIPPED, ...(await partsOfMap())]));
const report = await build({
  absWorkingDir: HERE,
  entryPoints: { fleet: "report/main.ts" },
  outdir: REPORT,
  write: false,
  bundle: true,
  minify: true,
  format: "iife",
  target: TARGET,
  charset: "utf8",
  legalComments: "none",
  banner: { js: `/*\n${(await licences(IN_REPORT)).replaceAll("*/", "")}*/` },
});
const inReport = {};
for (const { path, contents } of report.outputFiles) {
  await writeFile(path, contents);
  inReport[basename(path)] = createHash("sha256").update(contents).digest("hex");
}
const files = {};
for (const path of (await filesOf(OUT)).sort()) {
  const bytes = await readFile(path);
  files[relative(OUT, path).split(sep).join("/")] = {
    bytes: bytes.length,
    sha256: createHash("sha256").update(bytes).digest("hex"),
  };
}
const manifest = { sources_sha256: await digestOfSources(), report: inReport, files };
await writeFile(join(OUT, "manifest.json"), `${JSON.stringify(manifest, null, 2)}\n`);
