import { exampleFile, examples, lookAtMould, type Example } from "../data/api";
import { contentOf } from "../data/contents";
import { likelier, type Model, readModel, sidesOf, type Unit, UNITS } from "../data/model";
import { h } from "../elements";
import { ask } from "./asking";
import { known, t } from "../i18n";
import { FIRST, KINDS, NAMES, OF_MODELS } from "../data/kinds";
import type { Job, Kind } from "../data/types";

/** The file that a job is made from; for a reopened job, the file is on the server. */
export interface Source {
  name: string;
  file(): Promise<File>;
  /** The plan that made it; without one it is a file. */
  plan?: Job;
}

export interface Import {
  readonly kind: Kind;
  readonly source: Source | null;
  readonly mould: File | null;
  readonly parts: File[];
  readonly unit: Unit;
  /** The source as it is drawn, as soon as it is read; null where it is no model. */
  readonly model: Model | null;
  /** Takes over the file of a job and the files sent with it. */
  bring(source: Source, kind: Kind, unit: Unit, mould: File | null, parts: File[]): void;
  /** Takes the model's numbers in another unit. */
  measure(unit: Unit): void;
  clear(): void;
  askForFile(): void;
  /** Loads the list of examples from the server. */
  start(): void;
  retranslate(): void;
}

// Millimetres from which on a side has no decimals.
const WHOLE = 100;

const millimetres = (side: number): string => side.toFixed(side >= WHOLE ? 0 : side >= 1 ? 1 : 3);

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
  let model: Model | null = null;
  // The source that the model was read from.
  let read: Source | null = null;
  let mould: File | null = null;
  let parts: File[] = [];
  let offered: Example[] = [];

  const setKind = (next: Kind): void => {
    const other = next !== kind;
    kind = next;
    for (const [name, radio] of radios) radio.checked = name === kind;
    mouldRow.hidden = !KINDS[kind].mould;
    measure();
    if (!other) return;
    onKind(kind);
    onChange();
  };

  const take = (next: Source, nextKind: Kind): void => {
    source = next;
    setKind(nextKind);
    draw();
  };

  /** Reads the model that is to be looked at. */
  const look = async (): Promise<void> => {
    const wanted = KINDS[kind].model ? source : null;
    if (wanted === read) return;
    read = wanted;
    model = null;
    if (!wanted) return;
    const file = await wanted.file();
    const found = await readModel(file);
    if (read !== wanted) return;
    model = found;
    measure();
    onChange();
    // The server says what is wrong with a model that cannot be read.
    if (!found && (await contentOf(file)) === "model") await lookAtMould(file, unit.value);
  };

  /** Says how large the model is, and whether that is likely. */
  const measure = (): void => {
    look().catch(onProblem);
    unitRow.hidden = !KINDS[kind].unit;
    size.hidden = doubt.hidden = !model;
    if (!model) return;
    const inWords = (each: Unit): string => sidesOf(model!, each).map(millimetres).join(" × ");
    size.textContent = t("model.size", { size: inWords(unit.value as Unit), facets: model.corners.length / 9 });
    const others = likelier(model, unit.value as Unit);
    doubt.hidden = !others;
    const choices = (others ?? []).map((each) => {
      const about = { title: t("model.unit.about", { unit: each }) };
      return h("button", { type: "button", class: "link", ...about, onclick: () => setUnit(each) }, t("model.unit", { unit: each, size: inWords(each) }));
    });
    doubt.replaceChildren(t("model.doubt", { unit: unit.value }), ...choices.flatMap((each) => [" ", each]));
  };

  const setUnit = (next: Unit): void => {
    unit.value = next;
    measure();
    onChange();
  };

  /** Takes a file in place of the present one, after asking where both are courses. */
  const takeCourses = async (file: File, unasked: boolean): Promise<void> => {
    if (unasked && source && source.name !== file.name && !KINDS[kind].model) {
      const choices = { replace: t("ask.replace"), keep: t("ask.keep") };
      const answer = await ask("ask.courses", t("ask.courses.about", { name: source.name, other: file.name }), choices);
      if (answer !== "replace") return;
    }
    take(uploaded(file), FIRST);
  };

  /** Takes a model: beside courses it may be their mould; what else it is for is asked unless it is known. */
  const takeModel = async (file: File, together: boolean): Promise<void> => {
    let use: Kind | "mould" | null = together ? "mould" : KINDS[kind].model ? kind : OF_MODELS;
    if (!together && !KINDS[kind].model) {
      const others = { plan: t("ask.model.plan"), spray: t("ask.model.spray") };
      const [about, choices] = source
        ? [t("ask.model.about", { name: file.name, courses: source.name }), { mould: t("ask.model.mould"), ...others }]
        : [t("ask.model.alone", { name: file.name }), others];
      use = await ask<Kind | "mould">("ask.model", about, choices as Record<Kind | "mould", string>);
    }
    if (use === "mould") {
      mould = file;
      draw();
    } else if (use) take(uploaded(file), use);
  };

  /**
   * Takes every file for what its content says, one after the other; what cannot be taken is refused by name. Files
   * that nobody asked for, as they were dropped, replace others only after a question.
   */
  const takeFiles = async (files: File[], unasked: boolean): Promise<void> => {
    const found = await Promise.all(files.map(async (file) => ({ file, content: await contentOf(file) })));
    const of = (wanted: string): File[] => found.filter(({ content }) => content === wanted).map(({ file }) => file);
    const [courses, models, refused] = [of("courses"), of("model"), [] as string[]];
    parts = [...parts, ...of("part")];
    draw();
    for (const [index, file] of courses.entries()) await takeCourses(file, unasked || index > 0);
    for (const [index, file] of models.entries()) {
      if (index) refused.push(t("import.refused.model", { name: file.name }));
      else await takeModel(file, courses.length > 0);
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
    measure();
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
  const unit = h("select", { id: "unit", testid: "unit", onchange: () => setUnit(unit.value as Unit) });
  unit.append(...Object.keys(UNITS).map((each) => h("option", { value: each }, each)));
  const unitRow = h("div", { class: "row" }, h("label", { for: "unit", t: "import.unit" }), unit);
  const size = h("output", { testid: "model-size", class: "model-size" });
  const doubt = h("p", { testid: "model-doubt", class: "model-doubt", role: "status" });
  const mouldPicker = picker("import-mould", "import.choose-mould", ".stl,.step,.stp,.iges,.igs", false, ([chosen]) => {
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

  root.append(h("h2", { t: "import" }), zone, example, kinds, unitRow, size, doubt, more, chips);
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
      return unit.value as Unit;
    },
    get model() {
      return model;
    },
    bring(next, nextKind, nextUnit, nextMould, others) {
      parts = others;
      mould = nextMould;
      unit.value = nextUnit;
      take(next, nextKind);
    },
    measure: setUnit,
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
