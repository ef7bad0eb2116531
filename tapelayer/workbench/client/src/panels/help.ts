import drawing from "./axes.svg?raw";
import { dialog, h, translateAll } from "../elements";

const STEPS = ["import", "setup", "generate", "look", "verdict", "take"];
const AXES = ["x", "y", "z", "c", "a", "u", "v", "d", "q", "e"];
const SPRAY_AXES = ["x", "y", "z", "theta", "phi"];

// The paper's Table 2; it ends in dots, and the words that it leaves open are our choice.
const PRINTED = ["G00", "G01", "G02", "G03", "G04", "G90", "G91", "M20", "M21", "M22", "M23", "M24"];
const ASSIGNED = ["M25", "M26", "M27", "M28", "M32", "M33", "M00", "M30", "F"];
const SPRAY_WORDS = ["M08", "M09", "M03", "M05"];

const KEYS: [keys: string, key: string][] = [
  ["Space", "play"],
  ["← →", "step"],
  ["Shift ← →", "leap"],
  ["Home End", "ends"],
  ["Ctrl F", "search"],
  ["Ctrl Enter", "generate"],
  ["1 2 3 4", "tabs"],
  ["I N T", "fold"],
  ["M", "fill"],
  ["?", "help"],
  ["Esc", "close"],
];

// In the 3D view, while it has the focus.
const VIEW_KEYS: [keys: string, key: string][] = [
  ["← → ↑ ↓", "turn"],
  ["Shift ← → ↑ ↓", "move"],
  ["+ −", "zoom"],
  ["Home", "whole"],
];
const MOUSE = ["turn", "move", "zoom", "pick"];

function keyRows(keys: [keys: string, key: string][]): HTMLElement[] {
  return keys.map(([names, key]) =>
    h("tr", {}, h("th", { scope: "row" }, ...names.split(" ").map((name) => h("kbd", {}, name))), h("td", { t: `keys.${key}` })),
  );
}

function words(names: string[], key: string): HTMLElement {
  const rows = names.map((name) => h("tr", {}, h("th", { scope: "row" }, name), h("td", { t: `${key}.${name}` })));
  return h("table", { class: "words" }, h("tbody", {}, ...rows));
}

function axesDrawing(): HTMLElement {
  const svg = document.importNode(new DOMParser().parseFromString(drawing, "image/svg+xml").documentElement, true);
  return h("figure", {}, svg);
}

/** The help dialog: a short guide, the axes, the program's words and the keys. */
export function createHelp(): HTMLDialogElement {
  const steps = STEPS.map((step) => h("li", { t: `help.step.${step}` }));
  const mouse = MOUSE.map((what) =>
    h("tr", {}, h("th", { scope: "row", t: `mouse.${what}` }), h("td", { t: `mouse.${what}.does` })),
  );
  const element = dialog(
    "help-page",
    "help",
    h("section", {}, h("h3", { t: "help.guide" }), h("ol", {}, ...steps)),
    h("section", {}, h("h3", { t: "help.axes" }), axesDrawing()),
    h(
      "div",
      { class: "columns" },
      h("section", {}, h("h4", { t: "help.axes.lay" }), words(AXES, "axis")),
      h("section", {}, h("h4", { t: "help.axes.spray" }), words(SPRAY_AXES, "spray-axis")),
    ),
    h("h3", { t: "help.words" }),
    h(
      "div",
      { class: "columns" },
      h("section", {}, h("h4", { t: "help.words.printed" }), words(PRINTED, "word")),
      h(
        "section",
        {},
        h("h4", { t: "help.words.assigned" }),
        words(ASSIGNED, "word"),
        h("h4", { t: "help.words.spray" }),
        words(SPRAY_WORDS, "word"),
      ),
    ),
    h("section", {}, h("h3", { t: "help.keys" }), h("table", { class: "words keys" }, h("tbody", {}, ...keyRows(KEYS)))),
    h(
      "section",
      {},
      h("h3", { t: "help.view" }),
      h("table", { class: "words keys" }, h("tbody", {}, ...mouse, ...keyRows(VIEW_KEYS))),
    ),
    h("p", {}, h("a", { href: "/docs", target: "_blank", t: "help.api" })),
  );
  translateAll(element);
  return element;
}
