import { kinds } from "../data/api";
import { inWords, shown } from "../data/quantities";
import { h } from "../elements";
import { known, t } from "../i18n";
import type { Comparison, Job, KindTold } from "../data/types";
import { numeric, table, words } from "./tables";

export interface Compared {
  readonly root: HTMLElement;
  show(a: Job, b: Job, told: Comparison): void;
  retranslate(): void;
}

const HASH_DIGITS = 8;

/** A value of a setup as it stands there. */
function valueText(value: unknown): string {
  if (value === null || value === undefined) return "–";
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}

function keyName({ kind }: Comparison, section: string, key: string): string {
  const name = `setup.${kind}.${section}.${key}`;
  if (section === "job") return t("import.unit");
  return known(name) ? `${t(`setup.${kind}.${section}`)}: ${t(name)}` : `[${section}] ${key}`;
}

/** Two jobs beside each other: the numbers of their reports, the parameters and the files that differ. */
export function createComparison(heading = "jobs.compare.title"): Compared {
  const root = h("section", { testid: "comparison", class: "comparison", tLabel: heading });
  root.hidden = true;
  let drawn: { heads: string[]; told: Comparison; kind: KindTold } | null = null;

  const draw = (): void => {
    if (!drawn) return;
    const { heads, told, kind } = drawn;
    const quantities = new Map(kind.quantities.map((quantity) => [quantity.key, quantity]));
    const numbers = told.quantities.map(({ key, a, b }) => {
      const quantity = quantities.get(key)!;
      return [a === b ? inWords(quantity.words) : h("strong", {}, inWords(quantity.words)), shown(a, quantity), shown(b, quantity)];
    });
    const keys = told.setup.map(({ section, key, a, b }) => [keyName(told, section, key), valueText(a), valueText(b)]);
    const files = told.files.map(({ file, a, b }) => {
      const name = file === "source" || file === "mould" ? t(`jobs.compare.${file}`) : file;
      return [name, ...[a, b].map((hash) => h("code", { title: hash }, hash.slice(0, HASH_DIGITS) || "–"))];
    });
    const columns = [words(""), ...heads.map(numeric)];
    const differing = (caption: string, rows: (Node | string)[][]): HTMLElement =>
      rows.length ? table(t(caption), columns, rows) : h("p", {}, `${t(caption)}: ${t("jobs.compare.same")}`);
    root.replaceChildren(
      h("h3", {}, t(heading)),
      differing("jobs.compare.setup", keys),
      differing("jobs.compare.files", files),
      table(t("jobs.compare.numbers"), columns, numbers),
    );
    root.hidden = false;
  };

  return {
    root,
    show(a, b, told) {
      void kinds().then((all) => {
        // Two jobs of one file are told apart by their ids.
        const heads = [a, b].map(({ title, name, id }) => `${title || name} · ${id.slice(0, HASH_DIGITS)}`);
        drawn = { heads, told, kind: all.find(({ kind }) => kind === told.kind)! };
        draw();
        root.scrollIntoView({ block: "nearest" });
      });
    },
    retranslate: draw,
  };
}
