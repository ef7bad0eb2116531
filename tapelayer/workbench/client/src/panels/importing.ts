import { exampleFile, examples, type Example } from "../data/api";
import { contentOf } from "../data/contents";
import { h } from "../elements";
import { ask } from "./asking";
import { known, t } from "../i18n";
import { FIRST, KINDS, kindOfSource, NAMES } from "../data/kinds";
import type { Kind } from "../data/types";

/** The file that a job is made from; for a reopened job, the file is on the server. */
export interface Source {
  name: string;
  file(): Promise<File>;
}

export interface Import {
  readonly kind: Kind;
  readonly source: Source | null;
  readonly mould: File | null;
  readonly parts: File[];
  readonly unit: string;
  /** Takes over the file of a job and the files sent with it. */
  bring(source: Source, kind: Kind, unit: string, mould: File | null, parts: File[]): void;
  clear(): void;
  askForFile(): void;
  /** Loads the list of examples from the server. */
  start(): void;
  retranslate(): void;
}

const UNITS = ["mm", "cm", "m", "in"];

const uploaded = (file: File): Source => ({ name: file.name, file: async () => file });

/** A file input hidden behind its label. */
function picker(testid: string, key: string, accept: string, many: boolean, took: (files: File[]) => void): HTMLElement {
  const input = h("input", { type: "file", id: testid, testid, accept, multiple: many, class: "hidden-input" });
  input.addEventListener("change", () => {
    took([...(input.files ?? [])]);
    // Choosing the same file again, edited meanwhile, must fire a change as well.
    input.value = "";
  });
  return h("span", { class: "picker" }, input, h("label", { for: testid, class: "button", t: key }));
}

/** The import panel: the file, its kind and unit, and its additional files. */
export function createImport(
  root: HTMLElement,
  onKind: (kind: Kind) => void,
  onProblem: (error: unknown) => void,
  onChange: () => void,
  onSetup: (file: File) => Promise<void>,
  onRefused: (sentences: string[]) => void,
): Import {
  let kind: Kind = FIRST;
  let source: Source | null = null;
  let mould: File | null = null;
  let parts: File[] = [];
  let offered: Example[] = [];

  const setKind = (next: Kind): void => {
    const other = next !== kind;
    kind = next;
    for (const [name, radio] of radios) radio.checked = name === kind;
    unitRow.hidden = !KINDS[kind].unit;
    mouldRow.hidden = !KINDS[kind].mould;
    if (!other) return;
    onKind(kind);
    onChange();
  };

  const take = (next: Source, nextKind: Kind): void => {
    source = next;
    setKind(nextKind);
    draw();
  };

  /** Takes a file in place of the present one, after asking where both are courses. */
  const takeCourses = async (file: File, unasked: boolean): Promise<void> => {
    if (unasked && source && source.name !== file.name && !KINDS[kind].source) {
      const choices = { replace: t("ask.replace"), keep: t("ask.keep") };
      const answer = await ask("ask.courses", t("ask.courses.about", { name: source.name, other: file.name }), choices);
      if (answer !== "replace") return;
    }
    take(uploaded(file), FIRST);
  };

  /** Takes a model: beside courses it may be their mould. */
  const takeModel = async (file: File, together: boolean, unasked: boolean): Promise<void> => {
    let mouldWanted = together;
    if (unasked && !together && source && KINDS[kind].mould) {
      const choices = { mould: t("ask.model.mould"), spray: t("ask.model.spray") };
      const answer = await ask("ask.model", t("ask.model.about", { name: file.name, courses: source.name }), choices);
      if (answer === null) return;
      mouldWanted = answer === "mould";
    }
    if (!mouldWanted) {
      take(uploaded(file), kindOfSource("a.stl"));
      return;
    }
    mould = file;
    draw();
  };

  /**
   * Takes every file for what its content says, one after the other; what cannot be taken is refused by name. Files
   * that nobody asked for, as they were dropped, replace others only after a question.
   */
  const takeFiles = async (files: File[], unasked: boolean): Promise<void> => {
    const found = await Promise.all(files.map(async (file) => ({ file, content: await contentOf(file) })));
    const of = (wanted: string): File[] => found.filter(({ content }) => content === wanted).map(({ file }) => file);
    const [courses, models, refused] = [of("courses"), of("stl"), [] as string[]];
    parts = [...parts, ...of("part")];
    draw();
    for (const [index, file] of courses.entries()) await takeCourses(file, unasked || index > 0);
    for (const [index, file] of models.entries()) {
      if (index) refused.push(t("import.refused.model", { name: file.name }));
      else await takeModel(file, courses.length > 0, unasked);
    }
    for (const [index, file] of of("setup").entries()) {
      if (index) refused.push(t("import.refused.setup", { name: file.name }));
      else await onSetup(file);
    }
    for (const { name } of of("program")) refused.push(t("import.refused.program", { name }));
    for (const { name } of of("unknown")) refused.push(t("import.refused.unknown", { name }));
    if (refused.length) onRefused(refused);
  };

  const receive = (files: File[], unasked: boolean): void => void takeFiles(files, unasked).catch(onProblem);

  const draw = (): void => {
    fileName.textContent = source?.name ?? t("import.none");
    fileName.title = source?.name ?? "";
    fileName.classList.toggle("none", !source);
    const removable = [
      ...(mould ? [chip(mould.name, "import.mould", () => (mould = null))] : []),
      ...parts.map((part) => chip(part.name, "import.part", () => (parts = parts.filter((each) => each !== part)))),
    ];
    chips.replaceChildren(...removable);
    onChange();
  };

  const chip = (name: string, key: string, remove: () => void): HTMLElement => {
    const drop = (): void => {
      remove();
      draw();
    };
    const button = h("button", { type: "button", class: "quiet", tLabel: "remove", onclick: drop }, "✕");
    return h("li", {}, h("span", { class: "unit", t: key }), h("span", { class: "name", title: name }, name), button);
  };

  const fileName = h("output", { testid: "file-name", class: "file-name" });
  const chips = h("ul", { class: "chips" });
  const file = picker("import-file", "import.choose", "", true, (files) => receive(files, false));
  const zone = h("div", { class: "drop", testid: "drop-zone" }, file, h("span", { t: "import.drop", class: "about" }), fileName);
  const radios = new Map<Kind, HTMLInputElement>();
  const kinds = h("div", { role: "radiogroup", class: "segments", tLabel: "import.kind" });
  for (const name of NAMES) {
    const id = `kind-${name}`;
    const radio = h("input", { type: "radio", name: "kind", value: name, id, testid: id, onchange: () => setKind(name) });
    radios.set(name, radio);
    kinds.append(radio, h("label", { for: id, t: `kind.${name}` }));
  }
  const unit = h("select", { id: "unit", testid: "unit", onchange: () => onChange() }, ...UNITS.map((each) => h("option", { value: each }, each)));
  const unitRow = h("div", { class: "row" }, h("label", { for: "unit", t: "import.unit" }), unit);
  const mouldPicker = picker("import-mould", "import.choose-mould", ".stl", false, ([chosen]) => {
    mould = chosen ?? mould;
    draw();
  });
  const mouldRow = h("div", { class: "row", tTitle: "import.mould.about" }, mouldPicker);
  const further = picker("import-parts", "import.choose-parts", "", true, (files) => {
    parts = [...parts, ...files];
    draw();
  });
  const more = h("div", { class: "row", tTitle: "import.parts.about" }, mouldRow, further);
  const example = h("select", { id: "example-select", testid: "example-select", tLabel: "import.example" });
  example.addEventListener("change", () => {
    const chosen = offered.find(({ name }) => name === example.value);
    if (!chosen) return;
    exampleFile(chosen.name).then((found) => {
      take(uploaded(found), chosen.kind);
      example.value = "";
    }, onProblem);
  });

  const offer = (): void => {
    const title = ({ name, title: english }: Example): string =>
      known(`example.${name}`) ? t(`example.${name}`) : english;
    example.replaceChildren(
      h("option", { value: "" }, t("import.example")),
      ...offered.map((each) => h("option", { value: each.name }, title(each))),
    );
  };

  const over = (event: DragEvent): boolean => event.dataTransfer?.types.includes("Files") ?? false;
  addEventListener("dragover", (event) => {
    if (!over(event)) return;
    event.preventDefault();
    zone.classList.add("over");
  });
  addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) zone.classList.remove("over");
  });
  addEventListener("drop", (event) => {
    if (!over(event)) return;
    event.preventDefault();
    zone.classList.remove("over");
    receive([...event.dataTransfer!.files], true);
  });

  root.append(h("h2", { t: "import" }), zone, example, kinds, unitRow, more, chips);
  setKind(kind);
  draw();
  offer();
  return {
    get kind() {
      return kind;
    },
    get source() {
      return source;
    },
    get mould() {
      return KINDS[kind].mould ? mould : null;
    },
    get parts() {
      return parts;
    },
    get unit() {
      return unit.value;
    },
    bring(next, nextKind, nextUnit, nextMould, others) {
      parts = others;
      mould = nextMould;
      unit.value = nextUnit;
      take(next, nextKind);
    },
    clear() {
      source = null;
      mould = null;
      parts = [];
      draw();
    },
    askForFile: () => document.getElementById("import-file")!.focus(),
    start() {
      examples().then((found) => {
        offered = found;
        offer();
      }, onProblem);
    },
    retranslate() {
      draw();
      offer();
    },
  };
}
