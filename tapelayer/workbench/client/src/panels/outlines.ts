import type { Schema } from "../data/api";
import { arePoints, type Point, readLoops, readPoints, writeLoops, writePoints } from "../data/outline";
import { h } from "../elements";
import { t } from "../i18n";
import type { Field, Surroundings } from "./fields";

const LEAST = 3;
const [ROWS, FEW_ROWS] = [6, 3];
/** The boundary where points are: no name of a file can be it. */
const POINTS = "";

/** What is wrong with the points of a closed line; "" if nothing is. */
function faultOf(points: unknown[][]): string {
  const wrong = points.findIndex((point) => !arePoints([point]));
  if (wrong >= 0) return t("outline.point", { number: wrong + 1 });
  return points.length < LEAST ? t("outline.few", { count: points.length }) : "";
}

function area(id: string, rows: number): HTMLTextAreaElement {
  return h("textarea", { id, testid: id, rows, spellcheck: "false", class: "points" });
}

/** A boundary: the mould's edge, points of which each is a line of text, or a file that holds it. */
export function boundaryField(id: string, key: string, schema: Schema, around: Surroundings): Field {
  const how = h("select", { id, testid: id });
  const points = area(`${id}-points`, ROWS);
  points.setAttribute("aria-label", t("outline.points"));
  points.dataset["tLabel"] = "outline.points";
  const file = h("input", { type: "file", id: `${id}-file`, testid: `${id}-file`, class: "hidden-input" });
  const element = h(
    "div",
    { class: "group outline" },
    how,
    h("span", { class: "picker" }, file, h("label", { for: file.id, class: "button", t: "outline.file", tTitle: "outline.file.about" })),
    points,
  );
  const edge = String(schema.default);
  const put = (value: string): void => {
    const named = around.choices(key).map((each) => each.value);
    const names = [edge, POINTS, ...new Set([...named, ...(value === edge || value === POINTS ? [] : [value])])];
    const text = (name: string): string => (name === edge ? t("outline.edge") : name === POINTS ? t("outline.points") : name);
    how.replaceChildren(...names.map((name) => h("option", { value: name }, text(name))));
    how.value = value;
    points.hidden = value !== POINTS;
  };
  how.addEventListener("focus", () => put(how.value));
  how.addEventListener("input", () => put(how.value));
  file.addEventListener("change", () => {
    const [chosen] = file.files ?? [];
    file.value = "";
    if (chosen) around.load(chosen);
  });
  const read = (): unknown => {
    if (how.value !== POINTS) return how.value === edge ? undefined : how.value;
    return readPoints(points.value);
  };
  const write = (value: unknown): void => {
    const drawn = Array.isArray(value);
    points.value = drawn ? writePoints(value as Point[]) : "";
    put(drawn ? POINTS : String(value ?? edge));
  };
  write(undefined);
  const fault = (): string => (how.value === POINTS ? faultOf(readPoints(points.value)) : "");
  return { element, first: how, read, write, fault, offer: () => put(how.value) };
}

/** Holes: points of which each is a line of text, an empty line between two holes. */
export function holesField(id: string): Field {
  const element = area(id, FEW_ROWS);
  element.placeholder = "–";
  return {
    element: h("div", { class: "group outline" }, element),
    first: element,
    read() {
      const loops = readLoops(element.value);
      return loops.length ? loops : undefined;
    },
    write: (value) => void (element.value = Array.isArray(value) ? writeLoops(value as Point[][]) : ""),
    fault() {
      const faults = readLoops(element.value).map(faultOf);
      const number = faults.findIndex(Boolean);
      return number < 0 ? "" : t("outline.hole", { number: number + 1, fault: faults[number]! });
    },
  };
}
