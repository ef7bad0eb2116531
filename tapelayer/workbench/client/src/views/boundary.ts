import { Group, Vector3 } from "three";
import type { Outline, Point } from "../data/outline";
import { h } from "../elements";
import { t } from "../i18n";
import type { Mould } from "./mould";
import { Strokes } from "./strokes";

// Of longer lines the points are no handles.
const MOST_HANDLES = 300;
// A press so near to the line is one on the line, pixels.
const NEAR = 8;
// Metres that a key moves a point, and with Shift.
const [STEP, LEAP] = [0.001, 0.01];
const ARROWS: Record<string, [across: number, along: number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};

/** A point of a closed line: the boundary is line 0, then the holes. */
export interface Handle {
  loop: number;
  index: number;
}

/** What can be done to the points. */
export interface Grips {
  /** The place of the mould under the pointer. */
  cast(event: PointerEvent): Vector3 | null;
  /** Moves a point while it is dragged; `done` where it is let go. */
  move(handle: Handle, place: Vector3, done: boolean): void;
  remove(handle: Handle): void;
  /** A point was chosen. */
  choose(handle: Handle): void;
}

export const loopsOf = ({ boundary, holes }: Outline): Point[][] => [boundary ?? [], ...holes];

/** The ply's boundary and its holes as closed lines over the mould, with a handle for every point. Metres. */
export class Boundary {
  readonly object = new Group();
  readonly handles = h("div", { class: "scene-handles", role: "group", tLabel: "ply.points" });
  private readonly lines = [new Strokes(0xc2185b, 3), new Strokes(0x7b1fa2, 3)] as const;
  private loops: Point[][] = [];
  private draped: Vector3[][][] = [];
  private readonly places = new Map<HTMLElement, Vector3>();

  constructor(
    private readonly mould: Mould,
    private readonly grips: Grips,
  ) {
    this.object.add(...this.lines.map(({ object }) => object));
  }

  show(outline: Outline): void {
    const loops = loopsOf(outline);
    this.draped = loops.map((loop) => this.drape(loop));
    this.loops = loops;
    this.lines[0].show(this.draped[0]!);
    this.lines[1].show(this.draped.slice(1).flat());
    this.grip();
  }

  /** Where every handle stands. */
  *marks(): Iterable<[HTMLElement, Vector3]> {
    yield* this.places;
  }

  /** Focuses a point's handle. */
  focus(handle: Handle): void {
    this.handles.querySelector<HTMLElement>(selector(handle))?.focus();
  }

  /** The side of a closed line under a place of the page: the point that begins it. */
  side(x: number, y: number, project: (place: Vector3) => [number, number]): Handle | null {
    let found: Handle | null = null;
    let least = NEAR;
    this.draped.forEach((sides, loop) => {
      if (this.loops[loop]!.length < 2) return;
      sides.forEach((side, index) => {
        const pixels = side.map(project);
        for (let step = 1; step < pixels.length; step++) {
          const distance = distanceTo([x, y], pixels[step - 1]!, pixels[step]!);
          if (distance < least) [found, least] = [{ loop, index }, distance];
        }
      });
    });
    return found;
  }

  dispose(): void {
    for (const strokes of this.lines) strokes.dispose();
    this.handles.remove();
  }

  /** The sides of a closed line upon the mould. */
  private drape(loop: Point[]): Vector3[][] {
    if (loop.length < 2) return [];
    return loop.map((point, index) => this.mould.drape(this.mould.placeOf(point), this.mould.placeOf(loop[(index + 1) % loop.length]!)));
  }

  /** Makes a handle for every point; those that there are keep the focus and what is dragged. */
  private grip(): void {
    const wanted: Handle[] = [];
    if (this.loops.reduce((sum, loop) => sum + loop.length, 0) <= MOST_HANDLES) {
      this.loops.forEach((loop, number) => loop.forEach((_, index) => wanted.push({ loop: number, index })));
    }
    this.places.clear();
    const kept = wanted.map((handle) => {
      const point = this.loops[handle.loop]![handle.index]!;
      const element = this.handles.querySelector<HTMLElement>(selector(handle)) ?? this.made(handle);
      const place = t("ply.point.place", { x: point[0], y: point[1], z: point[2] });
      const names = { number: handle.index + 1, hole: handle.loop, place };
      const name = t(handle.loop ? "ply.point.hole" : "ply.point.boundary", names);
      element.setAttribute("aria-label", name);
      element.title = name;
      this.places.set(element, this.mould.placeOf(point));
      return element;
    });
    for (const element of [...this.handles.children]) if (!kept.includes(element as HTMLElement)) element.remove();
    for (const element of kept) if (!element.parentElement) this.handles.append(element);
  }

  private made(handle: Handle): HTMLElement {
    const { loop, index } = handle;
    const element = h("button", { type: "button", class: "scene-handle", testid: "point", "data-loop": loop, "data-index": index });
    element.addEventListener("focus", () => this.grips.choose(handle));
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      element.focus();
      element.setPointerCapture(event.pointerId);
      let moved: Vector3 | null = null;
      const move = (next: PointerEvent): void => {
        moved = this.grips.cast(next) ?? moved;
        if (moved) this.grips.move(handle, moved, false);
      };
      element.addEventListener("pointermove", move);
      const end = (): void => {
        element.removeEventListener("pointermove", move);
        if (moved) this.grips.move(handle, moved, true);
      };
      element.addEventListener("lostpointercapture", end, { once: true });
    });
    element.addEventListener("keydown", (event) => {
      const arrow = ARROWS[event.key];
      if (event.key === "Delete" || event.key === "Backspace") this.grips.remove(handle);
      else if (arrow) this.nudge(handle, arrow, event.shiftKey ? LEAP : STEP);
      else return;
      event.preventDefault();
      event.stopPropagation();
    });
    return element;
  }

  private nudge(handle: Handle, [across, along]: [number, number], step: number): void {
    const from = this.mould.placeOf(this.loops[handle.loop]![handle.index]!);
    const place = this.mould.above(from.add(new Vector3(across * step, along * step, 0)));
    if (place) this.grips.move(handle, place, true);
  }
}

const selector = ({ loop, index }: Handle): string => `[data-loop="${loop}"][data-index="${index}"]`;

/** Distance of a point to a line between two others, in pixels. */
function distanceTo([x, y]: [number, number], [ax, ay]: [number, number], [bx, by]: [number, number]): number {
  const [dx, dy] = [bx - ax, by - ay];
  const share = Math.min(Math.max(((x - ax) * dx + (y - ay) * dy) / Math.max(dx * dx + dy * dy, 1e-12), 0), 1);
  return Math.hypot(x - ax - share * dx, y - ay - share * dy);
}
