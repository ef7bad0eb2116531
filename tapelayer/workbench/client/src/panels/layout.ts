import { h } from "../elements";
import { remember, remembered } from "../data/state";

export interface Layout {
  header: HTMLElement;
  left: HTMLElement;
  notice: HTMLElement;
  scene: HTMLElement;
  player: HTMLElement;
  program: HTMLElement;
  tab(name: string): HTMLElement;
  showTab(name: string): void;
  onTab(listener: (name: string) => void): void;
}

interface Size {
  name: "left" | "right" | "bottom";
  start: () => number;
  least: number;
  most: () => number;
  grows: (dx: number, dy: number) => number;
}

const rem = (): number => parseFloat(getComputedStyle(document.documentElement).fontSize);

const wide = (): number => innerWidth / rem();
const high = (): number => innerHeight / rem();

// In rem, so that the layout scales with the font size.
const SIZES: Record<Size["name"], Size> = {
  left: { name: "left", start: () => 24, least: 17, most: () => wide() / 2.5, grows: (dx) => dx },
  // Wide enough for a block of ten axes if the window allows it.
  right: { name: "right", start: () => Math.max(27, 0.23 * wide()), least: 15, most: () => wide() / 2, grows: (dx) => -dx },
  bottom: { name: "bottom", start: () => Math.max(19, 0.27 * high()), least: 3, most: () => high() / 1.6, grows: (_, dy) => -dy },
};

/** A divider that changes a size by dragging or by the arrow keys; the size is remembered. */
function splitter(frame: HTMLElement, name: Size["name"]): HTMLElement {
  const { start, least, most, grows } = SIZES[name];
  const lying = name === "bottom";
  let size = remembered<number>(`size.${name}`, start());
  const bar = h("div", {
    class: `splitter ${name}`,
    role: "separator",
    tabindex: 0,
    "aria-orientation": lying ? "horizontal" : "vertical",
    tLabel: `splitter.${name}`,
  });
  const set = (wanted: number): void => {
    size = Math.min(Math.max(wanted, least), Math.max(most(), least));
    frame.style.setProperty(`--${name}`, `${size}rem`);
    bar.setAttribute("aria-valuenow", size.toFixed(0));
    bar.setAttribute("aria-valuemin", least.toFixed(0));
    bar.setAttribute("aria-valuemax", most().toFixed(0));
  };
  const keep = (): void => remember(`size.${name}`, size);
  bar.addEventListener("pointerdown", (event) => {
    const from = size;
    const { clientX, clientY } = event;
    bar.setPointerCapture(event.pointerId);
    const drag = (moved: PointerEvent): void =>
      set(from + grows(moved.clientX - clientX, moved.clientY - clientY) / rem());
    bar.addEventListener("pointermove", drag);
    const end = (): void => {
      bar.removeEventListener("pointermove", drag);
      keep();
    };
    bar.addEventListener("lostpointercapture", end, { once: true });
  });
  bar.addEventListener("dblclick", () => {
    set(start());
    keep();
  });
  bar.addEventListener("keydown", (event) => {
    const steps: Record<string, [number, number]> = lying
      ? { ArrowUp: [0, -1], ArrowDown: [0, 1] }
      : { ArrowLeft: [-1, 0], ArrowRight: [1, 0] };
    const step = steps[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    set(size + grows(...step));
    keep();
  });
  addEventListener("resize", () => set(remembered<number>(`size.${name}`, start())));
  set(size);
  return bar;
}

function tabs(names: string[]): Pick<Layout, "tab" | "showTab" | "onTab"> & { element: HTMLElement } {
  const listeners: ((name: string) => void)[] = [];
  const list = h("div", { role: "tablist", tLabel: "tabs" });
  const element = h("section", { class: "dock", tLabel: "tabs" }, list);
  const buttons = new Map<string, HTMLElement>();
  const panels = new Map<string, HTMLElement>();
  const show = (name: string): void => {
    for (const each of names) {
      const chosen = each === name;
      buttons.get(each)!.setAttribute("aria-selected", String(chosen));
      buttons.get(each)!.tabIndex = chosen ? 0 : -1;
      panels.get(each)!.hidden = !chosen;
    }
    for (const listener of listeners) listener(name);
  };
  for (const name of names) {
    const id = `tab-${name}`;
    const button = h("button", { type: "button", role: "tab", id, testid: id, t: `tab.${name}`, onclick: () => show(name) });
    const panel = h("div", { role: "tabpanel", id: `panel-${name}`, "aria-labelledby": id, class: `panel ${name}` });
    button.setAttribute("aria-controls", panel.id);
    buttons.set(name, button);
    panels.set(name, panel);
    list.append(button);
    element.append(panel);
  }
  list.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    event.stopPropagation();
    const at = names.findIndex((name) => buttons.get(name) === document.activeElement);
    const next = names.at((at + step) % names.length)!;
    show(next);
    buttons.get(next)!.focus();
  });
  show(names[0]!);
  return {
    element,
    tab: (name) => panels.get(name)!,
    showTab: show,
    onTab: (listener) => listeners.push(listener),
  };
}

/** The page's frame: header, import and parameters, scene and transport, program, and the tabs below. */
export function createLayout(root: HTMLElement): Layout {
  const { element: dock, ...tabbed } = tabs(["verdict", "plots", "ledger", "jobs"]);
  const part = (tag: "header" | "aside" | "main" | "section" | "div", name: string, label?: string): HTMLElement =>
    h(tag, { class: name, ...(label ? { tLabel: label } : {}) });
  const header = part("header", "top");
  const left = part("aside", "left", "region.input");
  const notice = h("div", { class: "notice", role: "alert" });
  const scene = part("section", "scene", "region.scene");
  const player = part("section", "player", "region.player");
  const program = part("section", "program", "region.program");
  const centre = h("main", { class: "centre" }, notice, scene, player);
  root.append(header, left, splitter(root, "left"), centre, splitter(root, "right"), program);
  root.append(splitter(root, "bottom"), dock);
  return { header, left, notice, scene, player, program, ...tabbed };
}
