import { h } from "../elements";

type Content = Node | string;

export interface Column {
  heading: string;
  /** Numbers are right-aligned, words left-aligned. */
  numeric: boolean;
}

export const words = (heading: string): Column => ({ heading, numeric: false });
export const numeric = (heading: string): Column => ({ heading, numeric: true });

const style = (column: Column): string | undefined => (column.numeric ? "number" : undefined);

/** A row of a table. */
export function line(columns: Column[], cells: Content[]): HTMLTableRowElement {
  return h("tr", {}, ...cells.map((cell, index) => h("td", { class: style(columns[index]!) }, cell)));
}

/** A table with a caption; rows hold their cells in the order of the columns. */
export function table(caption: string, columns: Column[], rows: Content[][], foot: Content[][] = []): HTMLTableElement {
  const headings = columns.map((column) =>
    column.heading ? h("th", { scope: "col", class: style(column) }, column.heading) : h("td"),
  );
  const made = h(
    "table",
    { class: "result" },
    h("caption", {}, caption),
    h("thead", {}, h("tr", {}, ...headings)),
    h("tbody", {}, ...rows.map((cells) => line(columns, cells))),
  );
  if (foot.length) made.append(h("tfoot", {}, ...foot.map((cells) => line(columns, cells))));
  return made;
}

/** Names and values under a heading, one pair per line. */
export function facts(heading: string, pairs: [string, Content][]): HTMLElement {
  const rows = pairs.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value)));
  return h("section", { class: "facts" }, h("h3", {}, heading), h("dl", {}, ...rows));
}

/** A button that looks like a link and goes to a place in the program. */
export function link(text: string, title: string, act: () => void): HTMLButtonElement {
  return h("button", { type: "button", class: "link", title, onclick: act }, text);
}

/** A range within its bounds as a bar; `beyond` is red, `unjudged` yellow. */
export function bar(begin: number, end: number, low: number, high: number, state: "" | "beyond" | "unjudged"): HTMLElement {
  const share = (value: number): number => Math.min(Math.max((value - low) / (high - low), 0), 1);
  const left = Math.min(share(begin), 0.98);
  const used = h("span", { class: `used ${state}` });
  used.style.left = `${100 * left}%`;
  used.style.width = `${100 * Math.max(share(end) - left, 0.02)}%`;
  return h("span", { class: "bar", "aria-hidden": "true" }, used);
}
