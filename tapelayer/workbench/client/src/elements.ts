import { t } from "./i18n";

type Prop = string | number | boolean | undefined | ((event: never) => void);

// Elements keep the keys of their texts, so that a change of language can update them.
const PLACES: [data: string, set: (element: HTMLElement, text: string) => void][] = [
  ["t", (element, text) => (element.textContent = text)],
  ["tTitle", (element, text) => (element.title = text)],
  ["tLabel", (element, text) => element.setAttribute("aria-label", text)],
  ["tPlaceholder", (element, text) => element.setAttribute("placeholder", text)],
];

/**
 * An element with attributes, listeners (`onclick`), texts by key (`t`, `tTitle`, `tLabel`, `tPlaceholder`) and
 * children; `testid` names it for tests and for people.
 */
export function h<Tag extends keyof HTMLElementTagNameMap>(
  tag: Tag,
  props: Record<string, Prop> = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[Tag] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (value === undefined || value === false) continue;
    if (typeof value === "function") element.addEventListener(name.slice(2), value as EventListener);
    else if (PLACES.some(([data]) => data === name)) element.dataset[name] = String(value);
    else if (name === "testid") element.dataset["testid"] = String(value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  element.append(...children);
  translate(element);
  return element;
}

function translate(element: HTMLElement): void {
  for (const [data, set] of PLACES) {
    const key = element.dataset[data];
    if (key !== undefined) set(element, t(key));
  }
}

/** Sets every keyed text at and below the element. */
export function translateAll(root: HTMLElement): void {
  for (const element of root.querySelectorAll<HTMLElement>("[data-t],[data-t-title],[data-t-label],[data-t-placeholder]")) {
    translate(element);
  }
}

/** Changes the key of an element's text. */
export function say(element: HTMLElement, key: string): void {
  element.dataset["t"] = key;
  translate(element);
}

/** Changes the key of an element's name and title. */
export function title(element: HTMLElement, key: string): void {
  element.dataset["tTitle"] = key;
  element.dataset["tLabel"] = key;
  translate(element);
}

/** A modal dialog with a heading. */
export function modal(testid: string, heading: string, ...children: (Node | string)[]): HTMLDialogElement {
  const title = h("h2", { t: heading, id: `${testid}-heading` });
  const body = h("div", { class: "body", tabindex: 0 }, ...children);
  const element = h("dialog", { testid, "aria-labelledby": title.id }, h("header", {}, title), body);
  document.body.append(element);
  return element;
}

/** A modal dialog with a heading, closable by button or backdrop. */
export function dialog(testid: string, heading: string, ...children: (Node | string)[]): HTMLDialogElement {
  const element = modal(testid, heading, ...children);
  const close = h("button", { type: "button", class: "quiet", tLabel: "close", onclick: () => element.close() }, "✕");
  element.querySelector("header")!.append(close);
  element.addEventListener("click", (event) => {
    // Clicks on the backdrop have the dialog itself as target; clicks on its content do not.
    if (event.target === element) element.close();
  });
  return element;
}
