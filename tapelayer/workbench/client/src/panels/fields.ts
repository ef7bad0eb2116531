import type { Schema } from "../data/api";
import { h } from "../elements";
import { t } from "../i18n";
import { boundaryField, holesField } from "./outlines";

/** The input for one key; `read` returns undefined if the key is not set. */
export interface Field {
  element: HTMLElement;
  first: HTMLElement;
  read(): unknown;
  write(value: unknown): void;
  /** What is wrong with the input, in the page's language; "" if nothing is. */
  fault(): string;
  /** Updates the choices, in the page's language. */
  offer?(): void;
}

export interface Axis {
  name: string;
  unit: string;
  lower: number;
  upper: number;
  speed: number;
}

export interface Surroundings {
  /** Names to choose from for a key that takes a name: controllers, uploaded files. */
  choices(key: string): { value: string; title: string }[];
  axes: Axis[];
  /** Takes the boundary and the holes of a file. */
  load(file: File): void;
}

/** The schema of a value that is set: references resolved, `null` removed. */
export function plain(schema: Schema, root: Schema): Schema {
  if (schema.$ref) return { ...root.$defs![schema.$ref.split("/").pop()!]!, ...schema };
  const variants = schema.anyOf?.filter((each) => each.type !== "null");
  if (variants?.length === 1) return { ...schema, ...plain(variants[0]!, root) };
  return schema;
}

export function fieldOf(id: string, key: string, schema: Schema, around: Surroundings): Field {
  if (key === "boundary") return boundaryField(id, key, schema, around);
  if (key === "holes") return holesField(id);
  if (schema.type === "boolean") return checkbox(id, schema);
  if (schema.enum) return choice(id, schema);
  if (schema.properties) return group(id, schema, around);
  if (schema.additionalProperties) return axisTable(id, key, schema, around);
  if (schema.type === "number" || schema.type === "integer") return number(id, schema, shown(schema.default));
  if (schema.type === "string") return key === "controller" ? named(id, key, schema, around) : text(id, key, around);
  return free(id, schema);
}

/** A value as text for an input. */
function shown(value: unknown): string {
  return value === null || value === undefined ? "" : Array.isArray(value) ? value.join(", ") : String(value);
}

function input(id: string, placeholder: string, more: Record<string, string> = {}): HTMLInputElement {
  return h("input", { type: "text", id, testid: id, placeholder, autocomplete: "off", spellcheck: "false", ...more });
}

function toNumber(written: string): unknown {
  const value = Number(written.replace(",", "."));
  // Text that is not a number is sent as it is, so that the server reports it.
  return written === "" ? undefined : Number.isFinite(value) ? value : written;
}

function outside(value: unknown, schema: Schema): string {
  if (value === undefined) return "";
  if (typeof value !== "number") return t("field.number");
  const { exclusiveMinimum: above, minimum: least, exclusiveMaximum: below, maximum: most } = schema;
  if (above !== undefined && !(value > above)) return t("field.above", { limit: above });
  if (least !== undefined && !(value >= least)) return t("field.least", { limit: least });
  if (below !== undefined && !(value < below)) return t("field.below", { limit: below });
  if (most !== undefined && !(value <= most)) return t("field.most", { limit: most });
  if (schema.type === "integer" && !Number.isInteger(value)) return t("field.integer");
  return "";
}

function number(id: string, schema: Schema, placeholder: string): Field {
  const element = input(id, placeholder || "–", { inputmode: "decimal", class: "number" });
  const read = (): unknown => toNumber(element.value.trim());
  const write = (value: unknown): void => void (element.value = shown(value));
  return { element, first: element, read, write, fault: () => outside(read(), schema) };
}

/** An input for a number, a word such as auto, or numbers separated by commas. */
function free(id: string, schema: Schema): Field {
  const words = schema.anyOf?.map((each) => each.const) ?? [];
  const lists = schema.anyOf?.some((each) => each.type === "array");
  const element = input(id, shown(schema.default), { class: "number" });
  const read = (): unknown => {
    const written = element.value.trim();
    if (words.includes(written)) return written;
    if (lists && /[,;\s]/.test(written)) return written.split(/[,;\s]+/).map(toNumber);
    return toNumber(written);
  };
  const fault = (): string => {
    const value = read();
    const values = Array.isArray(value) ? value : [value];
    if (values.every((each) => each === undefined || typeof each === "number" || words.includes(each))) return "";
    return t(lists ? "field.numbers" : "field.word", { words: words.filter(Boolean).join(", ") });
  };
  return { element, first: element, read, write: (value) => void (element.value = shown(value)), fault };
}

function text(id: string, key: string, around: Surroundings): Field {
  const list = h("datalist", { id: `${id}-names` });
  const box = input(id, "–", { list: list.id });
  const offer = (): void =>
    list.replaceChildren(...around.choices(key).map(({ value, title }) => h("option", { value }, title)));
  box.addEventListener("focus", offer);
  const element = h("div", {}, box, list);
  const read = (): unknown => box.value.trim() || undefined;
  return { element, first: box, read, write: (value) => void (box.value = shown(value)), fault: () => "" };
}

function checkbox(id: string, schema: Schema): Field {
  const element = h("input", { type: "checkbox", id, testid: id });
  const write = (value: unknown): void => void (element.checked = Boolean(value ?? schema.default));
  write(undefined);
  const read = (): unknown => (element.checked === schema.default ? undefined : element.checked);
  return { element, first: element, read, write, fault: () => "" };
}

function choice(id: string, schema: Schema): Field {
  const options = schema.enum!.map((value) => h("option", { value, t: `option.${value}` }));
  const element = h("select", { id, testid: id }, ...options);
  const write = (value: unknown): void => void (element.value = shown(value ?? schema.default));
  write(undefined);
  const read = (): unknown => (element.value === schema.default ? undefined : element.value);
  return { element, first: element, read, write, fault: () => "" };
}

/** A choice of names, which may grow while the page is open. */
function named(id: string, key: string, schema: Schema, around: Surroundings): Field {
  const element = h("select", { id, testid: id });
  const put = (value: string): void => {
    const choices = around.choices(key);
    const all = choices.some((each) => each.value === value) ? choices : [...choices, { value, title: "" }];
    element.replaceChildren(...all.map(({ value: name, title }) => h("option", { value: name, title }, name)));
    element.value = value;
    tell();
  };
  const tell = (): void => void (element.title = element.selectedOptions[0]?.title ?? "");
  const offer = (): void => put(element.value);
  element.addEventListener("focus", offer);
  element.addEventListener("change", tell);
  const write = (value: unknown): void => put(shown(value ?? schema.default));
  write(undefined);
  const read = (): unknown => (element.value === schema.default ? undefined : element.value);
  return { element, first: element, read, write, fault: () => "", offer };
}

/** Inputs side by side whose values form one table. */
function together(element: HTMLElement, parts: Map<string, Field>): Field {
  return {
    element,
    first: [...parts.values()][0]?.first ?? element,
    read() {
      const set = [...parts].map(([name, part]) => [name, part.read()]).filter(([, value]) => value !== undefined);
      return set.length ? Object.fromEntries(set) : undefined;
    },
    write(value) {
      for (const [name, part] of parts) part.write((value as Record<string, unknown> | undefined)?.[name]);
    },
    fault: () => [...parts.values()].map((part) => part.fault()).find(Boolean) ?? "",
  };
}

function group(id: string, schema: Schema, around: Surroundings): Field {
  const parts = new Map<string, Field>();
  const element = h("div", { class: "group" });
  for (const [key, property] of Object.entries(schema.properties!)) {
    const part = fieldOf(`${id}-${key}`, key, property, around);
    parts.set(key, part);
    element.append(h("label", { for: `${id}-${key}`, t: `member.${key}` }), part.element);
  }
  return together(element, parts);
}

/** A row per axis of the key's unit: two numbers for travel, one for speed; placeholders show the machine's own. */
function axisTable(id: string, key: string, schema: Schema, around: Surroundings): Field {
  const inner = schema.additionalProperties as Schema;
  const unit = /_deg(_|$)/.test(key) ? "deg" : "mm";
  const parts = new Map<string, Field>();
  const element = h("div", { class: "group" });
  for (const axis of around.axes.filter((each) => each.unit === unit)) {
    const place = `${id}-${axis.name}`;
    const part =
      inner.type === "array" ? range(place, axis) : number(place, inner, shown(Number(axis.speed.toFixed(3))));
    part.first.setAttribute("aria-label", axis.name);
    parts.set(axis.name, part);
    element.append(h("label", { for: part.first.id, class: "axis" }, axis.name), part.element);
  }
  const known = together(element, parts);
  let others: Record<string, unknown> = {};
  return {
    ...known,
    // Axes that the built-in URDF does not have get no row, and keep their values.
    read() {
      const value = { ...others, ...(known.read() as object | undefined) };
      return Object.keys(value).length ? value : undefined;
    },
    write(value) {
      const all = Object.entries((value as Record<string, unknown> | undefined) ?? {});
      others = Object.fromEntries(all.filter(([name]) => !parts.has(name)));
      known.write(value);
    },
  };
}

function range(id: string, axis: Axis): Field {
  const lower = number(`${id}-lower`, {}, shown(Number(axis.lower.toFixed(3))));
  const upper = number(`${id}-upper`, {}, shown(Number(axis.upper.toFixed(3))));
  upper.first.setAttribute("aria-label", axis.name);
  const given = (): unknown[] => [lower.read(), upper.read()];
  return {
    element: h("div", { class: "range" }, lower.element, "…", upper.element),
    first: lower.first,
    read() {
      const [low, high] = given();
      if (low === undefined && high === undefined) return undefined;
      return [low ?? axis.lower, high ?? axis.upper];
    },
    write(value) {
      const [low, high] = Array.isArray(value) ? (value as unknown[]) : [];
      lower.write(low);
      upper.write(high);
    },
    fault() {
      const [low = axis.lower, high = axis.upper] = given();
      const found = lower.fault() || upper.fault();
      return found || (Number(low) < Number(high) ? "" : t("field.ordered"));
    },
  };
}
