import { controllers, machines, setupSchema, type Controller } from "../data/api";
import { h } from "../elements";
import { fieldOf, plain, type Field, type Surroundings } from "./fields";
import { known, t } from "../i18n";
import { inLanguage } from "./sentences";
import { FIRST, KINDS, NAMES } from "../data/kinds";
import type { Fault, Kind, SetupValues } from "../data/types";
import { remember, remembered } from "../data/state";

const UNITS: [suffix: RegExp, unit: string][] = [
  [/_mm_per_s$/, "mm/s"],
  [/_deg_per_s$/, "°/s"],
  [/_m_per_min$/, "m/min"],
  [/_l_per_min$/, "l/min"],
  [/_mm3_per_s$/, "mm³/s"],
  [/_mm$/, "mm"],
  [/_deg$/, "°"],
  [/_ms$/, "ms"],
  [/_mpa$/, "MPa"],
  [/_percent$/, "%"],
  [/_m$/, "m"],
  [/_s$/, "s"],
  [/_a$/, "A"],
  [/_v$/, "V"],
];

/** Keys whose values are places on the model, in its unit. */
const PLACES = /^(boundary|holes|seed)$/;

interface Row {
  section: string;
  key: string;
  field: Field;
  element: HTMLElement;
  faultLine: HTMLElement;
  /** What the server found wrong with the value; null after it was changed. */
  told: Fault | null;
}

export interface Form {
  /** Shows the parameters of a kind of job with their last values. */
  show(kind: Kind): Promise<void>;
  values(): SetupValues;
  write(values: SetupValues): void;
  /** Changes some parameters of a section; undefined: to the default. */
  put(section: string, values: Record<string, unknown>): void;
  /** Says in which unit places on the model are. */
  measure(unit: string): void;
  /** Whether it shows the parameters of a kind, and all of its fields are valid. */
  sound(kind: Kind): boolean;
  /** Whether all fields are valid; focuses the first invalid one. */
  check(): boolean;
  /** Shows each fault at its field. */
  faults(faults: Fault[]): void;
  /** Opens the section of a parameter and focuses its field. */
  go(section: string, key: string): void;
  retranslate(): void;
}

function titleOf({ name, title }: Controller): string {
  return known(`controller.${name}`) ? t(`controller.${name}`) : title;
}

function unitOf(key: string): string {
  return UNITS.find(([suffix]) => suffix.test(key))?.[1] ?? "";
}

/** Makes a field one that has to be filled in. */
function demand(field: Field): void {
  const { fault } = field;
  field.fault = () => (field.read() === undefined ? t("field.required") : fault());
  field.first.setAttribute("aria-required", "true");
}

/** The form of the parameters, built from the setup's schema; it sets only values that differ from the defaults. */
export function createForm(
  root: HTMLElement,
  files: () => string[],
  load: Surroundings["load"],
  onChange: () => void,
): Form {
  const drafts = Object.fromEntries(
    NAMES.map((kind) => [kind, remembered<SetupValues>(`setup.${kind}`, {})]),
  ) as Record<Kind, SetupValues>;
  let rows: Row[] = [];
  let counts = new Map<string, HTMLElement>();
  // Where the model's unit stands.
  let places: HTMLElement[] = [];
  let modelUnit = "mm";
  let current: Kind = FIRST;
  let controls: Controller[] = [];

  const choices = (key: string): { value: string; title: string }[] => {
    const built = key === "controller" ? controls.map((each) => ({ value: each.name, title: titleOf(each) })) : [];
    const ending = { controller: /\.toml$/i, urdf: /\.urdf$/i }[key] ?? /(?<!\.urdf|\.toml)$/i;
    return [...built, ...files().filter((name) => ending.test(name)).map((value) => ({ value, title: value }))];
  };

  const values = (): SetupValues => {
    const set: SetupValues = {};
    for (const { section, key, field } of rows) {
      const value = field.read();
      if (value !== undefined) (set[section] ??= {})[key] = value;
    }
    return set;
  };

  const changed = (): void => {
    const set = values();
    drafts[current] = set;
    remember(`setup.${current}`, set);
    for (const row of rows) row.element.classList.toggle("changed", set[row.section]?.[row.key] !== undefined);
    for (const [section, count] of counts) count.textContent = String(Object.keys(set[section] ?? {}).length || "");
    onChange();
  };

  const mark = (row: Row, sentence: string): void => {
    row.faultLine.textContent = sentence;
    row.element.classList.toggle("faulty", sentence !== "");
    if (sentence) row.field.first.setAttribute("aria-invalid", "true");
    else row.field.first.removeAttribute("aria-invalid");
  };

  /** The server's sentence about a field, without the name of the field. */
  const told = (fault: Fault): string => inLanguage(fault, fault.sentence).replace(/^\[\w+\] [\w.]+: /, "");

  const rowOf = (section?: string | null, key?: string | null): Row | undefined =>
    rows.find((each) => each.section === section && each.key === key);

  const write = (set: SetupValues): void => {
    for (const row of rows) {
      row.told = null;
      row.field.write(set[row.section]?.[row.key]);
      mark(row, "");
    }
    changed();
  };

  const open = (row: Row): void => {
    row.element.closest("details")!.open = true;
    row.element.scrollIntoView({ block: "nearest" });
  };

  return {
    async show(kind) {
      const [schema, models, built] = await Promise.all([setupSchema(kind), machines(), controllers()]);
      current = kind;
      controls = built;
      const machine = models.find(({ name }) => name === KINDS[kind].machine);
      const around = { choices, axes: machine?.axes ?? [], load };
      const openSections = remembered<string[]>(`open.${kind}`, ["part", "process", "spray", "ply"]);
      rows = [];
      places = [];
      counts = new Map();
      const own = Object.entries(schema.properties ?? {}).filter(([section]) => section !== KINDS[kind].source);
      const sections = own.map(([section, reference]) => {
        const count = h("span", { class: "count" });
        counts.set(section, count);
        const summary = h("summary", {}, h("span", { t: `setup.${kind}.${section}` }), count);
        const details = h("details", { testid: `section-${section}` }, summary);
        details.open = openSections.includes(section);
        details.addEventListener("toggle", () => {
          const names = [...root.querySelectorAll("details")].filter((each) => each.open);
          remember(`open.${kind}`, names.map((each) => each.dataset["testid"]!.replace("section-", "")));
        });
        const { properties = {}, required = [] } = plain(reference, schema);
        for (const [key, property] of Object.entries(properties)) {
          const id = `field-${section}-${key}`;
          const name = `setup.${kind}.${section}.${key}`;
          const field = fieldOf(id, key, plain(property, schema), around);
          if (required.includes(key)) demand(field);
          const faultLine = h("p", { class: "fault", id: `${id}-fault` });
          const about = h("p", { class: "about", id: `${id}-about`, t: `${name}.about` });
          const label = h("label", { for: field.first.id, tTitle: `${name}.about` }, h("span", { t: name }));
          const unit = h("span", { class: "unit", title: key }, unitOf(key));
          if (PLACES.test(key)) places.push(unit);
          const element = h("div", { class: "field" }, label, field.element, unit, about, faultLine);
          // A field with several inputs is announced as a group.
          if (field.first !== field.element) element.classList.add("wide");
          field.first.setAttribute("aria-describedby", `${about.id} ${faultLine.id}`);
          const row: Row = { section, key, field, element, faultLine, told: null };
          field.element.addEventListener("input", () => {
            row.told = null;
            mark(row, field.fault());
            changed();
          });
          rows.push(row);
          details.append(element);
        }
        return details;
      });
      root.replaceChildren(...sections);
      for (const each of places) each.textContent = modelUnit;
      write(drafts[kind]);
    },
    values,
    write,
    put(section, set) {
      for (const [key, value] of Object.entries(set)) {
        const row = rowOf(section, key);
        if (!row) continue;
        row.told = null;
        row.field.write(value);
        mark(row, "");
      }
      changed();
    },
    measure(unit) {
      modelUnit = unit;
      for (const each of places) each.textContent = unit;
    },
    sound: (kind) => kind === current && rows.length > 0 && rows.every(({ field }) => !field.fault()),
    check() {
      for (const row of rows) mark(row, row.field.fault());
      const faulty = rows.find((row) => row.faultLine.textContent);
      if (!faulty) return true;
      open(faulty);
      faulty.field.first.focus();
      return false;
    },
    faults(faults) {
      for (const fault of faults) {
        const row = rowOf(fault.section, fault.key);
        if (!row) continue;
        row.told = fault;
        mark(row, told(fault));
        open(row);
      }
    },
    go(section, key) {
      const row = rowOf(section, key);
      if (!row) return;
      open(row);
      row.field.first.focus();
    },
    retranslate() {
      for (const { field } of rows) field.offer?.();
      for (const row of rows) if (row.faultLine.textContent) mark(row, row.field.fault() || (row.told ? told(row.told) : ""));
    },
  };
}

