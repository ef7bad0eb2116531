import "./layout.css";
import { h, title } from "../elements";
import { remember, remembered } from "../data/state";

export interface Layout {
  header: HTMLElement;
  left: HTMLElement;
  notice: HTMLElement;
  scene: HTMLElement;
  player: HTMLElement;
  program: HTMLElement;
  /** The buttons that fold panes away. */
  folds: HTMLElement;
  tab(name: string): HTMLElement;
  showTab(name: string): void;
  onTab(listener: (name: string) => void): void;
  /** Folds a pane away, or unfolds it. */
  fold(name: Foldable): void;
  /** Lets the pane that has the focus fill the window, else the machine; or undoes it. */
  fill(): void;
  /** Makes sure that a pane is on the page. */
  reveal(name: Pane): void;
}

const FOLDABLE = ["left", "dock", "program"] as const;
export type Foldable = (typeof FOLDABLE)[number];
const FILLING = ["centre", "program", "dock"] as const;
type Filling = (typeof FILLING)[number];
export type Pane = Foldable | Filling;

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

/** Which panes are folded away and which one fills the window; both are remembered. */
class Panes {
  readonly folds: HTMLElement;
  private readonly folded = new Set(remembered<Foldable[]>("folded", []));
  private full = remembered<Filling | "">("full", "");
  private readonly foldButtons = new Map<Foldable, HTMLElement>();
  private readonly fillButtons = new Map<Filling, HTMLElement>();

  constructor(private readonly root: HTMLElement) {
    for (const name of FOLDABLE) {
      const texts = { tLabel: `pane.${name}`, tTitle: `pane.${name}.about` };
      const press = (): void => this.fold(name);
      this.foldButtons.set(name, h("button", { type: "button", class: `fold fold-${name}`, testid: `fold-${name}`, onclick: press, ...texts }));
    }
    for (const name of FILLING) {
      const press = (): void => this.fill(name);
      this.fillButtons.set(name, h("button", { type: "button", class: "enlarge", testid: `fill-${name}`, onclick: press }));
    }
    this.folds = h("div", { class: "panes", role: "group", tLabel: "panes" }, ...this.foldButtons.values());
    this.draw();
  }

  /** The button that lets a pane fill the window. */
  button(name: Filling): HTMLElement {
    return this.fillButtons.get(name)!;
  }

  fold(name: Foldable): void {
    // A pane that another one covers is asked for, not folded.
    if (this.folded.has(name) || this.covered(name)) this.folded.delete(name);
    else this.folded.add(name);
    this.full = "";
    this.draw();
  }

  fill(name: Filling): void {
    this.full = this.full === name ? "" : name;
    if (name !== "centre") this.folded.delete(name);
    this.draw();
    scrollTo(0, 0);
  }

  /** Lets the pane that has the focus fill the window, else the machine; or undoes it. */
  fillFocused(): void {
    const focused = FILLING.find((name) => this.button(name).closest(`.${name}`)?.contains(document.activeElement));
    this.fill(this.full || (focused ?? "centre"));
  }

  reveal(name: Pane): void {
    if (this.covered(name)) this.full = "";
    this.folded.delete(name as Foldable);
    this.draw();
  }

  private covered(name: Pane): boolean {
    return this.full !== "" && this.full !== name;
  }

  private draw(): void {
    const { folded, full, root } = this;
    root.dataset["folded"] = [...folded].join(" ");
    if (full) root.dataset["full"] = full;
    else delete root.dataset["full"];
    for (const [name, button] of this.foldButtons) {
      button.setAttribute("aria-pressed", String(!folded.has(name) && !this.covered(name)));
    }
    for (const [name, button] of this.fillButtons) {
      const filling = name === full;
      button.textContent = filling ? "⤡" : "⤢";
      button.setAttribute("aria-pressed", String(filling));
      title(button, filling ? "pane.restore" : "pane.fill");
    }
    remember("folded", [...folded]);
    remember("full", full);
  }
}

function tabs(names: string[], beside: HTMLElement): Pick<Layout, "tab" | "showTab" | "onTab"> & { element: HTMLElement } {
  const listeners: ((name: string) => void)[] = [];
  const list = h("div", { role: "tablist", tLabel: "tabs" });
  const element = h("section", { class: "dock", tLabel: "tabs" }, h("div", { class: "dock-head" }, list, beside));
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
  const panes = new Panes(root);
  const { element: dock, ...tabbed } = tabs(["verdict", "plots", "ledger", "jobs"], panes.button("dock"));
  const header = h("header", { class: "top" });
  const notice = h("div", { class: "notice", role: "alert" });
  const left = h("aside", { class: "left", tLabel: "region.input" }, splitter(root, "left"));
  const scene = h("section", { class: "scene", tLabel: "region.scene" });
  const player = h("section", { class: "player", tLabel: "region.player" });
  const centre = h("main", { class: "centre" }, h("div", { class: "view" }, scene, panes.button("centre")), player);
  const program = h("div", {});
  const right = h("section", { class: "program", tLabel: "region.program" }, splitter(root, "right"), program, panes.button("program"));
  dock.append(splitter(root, "bottom"));
  root.append(header, notice, left, centre, right, dock);
  return {
    header,
    left,
    notice,
    scene,
    player,
    program,
    folds: panes.folds,
    ...tabbed,
    showTab(name) {
      panes.reveal("dock");
      tabbed.showTab(name);
    },
    fold: (name) => panes.fold(name),
    fill: () => panes.fillFocused(),
    reveal: (name) => panes.reveal(name),
  };
}
