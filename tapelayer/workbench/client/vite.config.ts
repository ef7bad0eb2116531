import { existsSync, readFileSync, readdirSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { defineConfig, type Plugin } from "vite";

const HERE = dirname(fileURLToPath(import.meta.url));
const SWAGGER = join(HERE, "node_modules", "swagger-ui-dist");
const APACHE = join(HERE, "..", "..", "..", "LICENSE");

/** The package directory (below node_modules) that a bundled module belongs to; undefined for our own. */
function packageOf(module: string): string | undefined {
  return /^.*\/node_modules\/((?:@[^/]+\/)?[^/]+)\//.exec(module)?.[1];
}

/** The licence and notice texts that a package carries. */
function notices(name: string): string {
  const folder = join(HERE, "node_modules", name);
  const { version, license } = JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
  const files = readdirSync(folder).filter((file) => /^(licen[cs]e|notice|.*bundle\.js\.LICENSE)/i.test(file)).sort();
  const texts = files
    .filter((file) => !/-es-bundle/.test(file))
    .map((file) => readFileSync(join(folder, file), "utf8").trim());
  if (!texts.length) {
    if (license !== "Apache-2.0" || !existsSync(APACHE)) throw new Error(`${name} has no licence file: ${license}`);
    texts.push(readFileSync(APACHE, "utf8").trim());
  }
  return [`${name} ${version} (${license})`, "", ...texts].join("\n\n");
}

/** Copies of the files of the API's page, and the notices of everything that the build ships. */
function shipped(): Plugin {
  return {
    name: "shipped",
    apply: "build",
    generateBundle(_, bundle) {
      for (const fileName of ["swagger-ui-bundle.js", "swagger-ui.css"]) {
        // The source maps stay behind, and so does the mention of them.
        const source = readFileSync(join(SWAGGER, fileName), "utf8").replace(/\n\/[/*]# sourceMappingURL=.*\s*$/, "\n");
        this.emitFile({ type: "asset", fileName: `swagger/${fileName}`, source });
      }
      const modules = Object.values(bundle).flatMap((chunk) => (chunk.type === "chunk" ? chunk.moduleIds : []));
      const names = new Set(modules.map(packageOf).filter((name) => name !== undefined));
      names.add("swagger-ui-dist").add("uplot");
      const source = [...names].sort().map(notices).join(`\n\n${"-".repeat(120)}\n\n`) + "\n";
      this.emitFile({ type: "asset", fileName: "NOTICES.txt", source });
    },
  };
}

export default defineConfig({
  base: "./",
  plugins: [shipped()],
  build: {
    outDir: "../static",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: false,
    cssCodeSplit: false,
    chunkSizeWarningLimit: 2000,
    rolldownOptions: {
      output: {
        entryFileNames: "workbench.js",
        chunkFileNames: "[name].js",
        assetFileNames: "workbench[extname]",
      },
    },
  },
  server: {
    proxy: Object.fromEntries(
      ["/api", "/problems", "/healthz", "/openapi.json", "/docs"].map((path) => [path, "http://127.0.0.1:8765"]),
    ),
  },
});
