import { Box3, Group, Vector3 } from "three";
import type { Raycaster } from "three";
import type { Region } from "../data/api";
import type { Model, Unit } from "../data/model";
import { areLoops, arePoints, type Outline, type Point } from "../data/outline";
import type { Planned, SetupValues } from "../data/types";
import { h, translateAll } from "../elements";
import { t } from "../i18n";
import { Boundary, type Handle, loopsOf } from "./boundary";
import { Courses, type Map2D } from "./courses";
import { Mould } from "./mould";
import { Rosette } from "./rosette";
import { Strokes } from "./strokes";
import { DIRECTIONS, type Direction } from "./view";
import { MM } from "./work";

/** What is drawn, as the ply's values have it; null: as if it were not set. */
export interface Drawn {
  boundary?: Point[] | null;
  holes?: Point[][] | null;
  seed?: Point | null;
}

/** What the board needs of the view. */
export interface Sight {
  /** The ray under the pointer. */
  ray(event: PointerEvent | MouseEvent): Raycaster;
  /** Where a place is seen, pixels from the view's left and top. */
  project(place: Vector3): [number, number];
  look(direction: Direction): void;
  /** A course was chosen. */
  choose(course: number): void;
  draw(): void;
}

/** What is being drawn: the closed line of that number; null for nothing. */
type Drawing = number | null;

const MOST_UNDONE = 100;
const ALONG = new Vector3(0, 1, 0);

/** A mould on which a ply is drawn: its boundary, its holes, its seed and the direction of its courses. */
export class Board {
  readonly object = new Group();
  readonly tools = h("div", { class: "scene-tools drawing", role: "toolbar", tLabel: "ply.drawing" });
  readonly overlay: HTMLElement;
  private readonly mould: Mould;
  private readonly boundary: Boundary;
  private readonly rosette: Rosette;
  private readonly covered = new Strokes(0x18222c, 2);
  private readonly seed = h("button", { type: "button", class: "scene-handle seed", testid: "seed" });
  private readonly drawBoundary = tool("draw-boundary", "ply.draw", () => this.begin(0));
  private readonly drawHole = tool("draw-hole", "ply.hole", () => this.begin(Math.max(loopsOf(this.outline).length, 1)));
  private readonly removing = tool("remove-point", "ply.remove", () => this.chosen && this.remove(this.chosen));
  private readonly undoing = tool("undo-drawing", "ply.undo", () => this.undo());
  private readonly clearing = tool("clear-drawing", "ply.clear", () => this.edit({ boundary: null, holes: [] }));
  private readonly told = h("output", { class: "scene-hint", testid: "drawing" });
  private outline: Outline = { boundary: null, holes: [] };
  private place: Vector3;
  private values: Record<string, unknown> = {};
  private past: Drawn[] = [];
  private drawing: Drawing = null;
  private chosen: Handle | null = null;
  /** What the ply covers, as long as nothing was changed since. */
  private region: Region | null = null;
  private courses: Courses | null = null;
  // Counts the plans, so that a late one is dropped.
  private planned = 0;

  /** @param edited takes what was drawn; null where nothing is to be drawn on the mould. */
  constructor(
    model: Model,
    unit: Unit,
    private readonly sight: Sight,
    private readonly edited: ((drawn: Drawn) => void) | null,
    values: SetupValues,
  ) {
    this.mould = new Mould(model, unit);
    this.place = this.mould.middle();
    this.rosette = new Rosette(this.mould);
    this.boundary = new Boundary(this.mould, {
      cast: (event) => this.mould.hit(sight.ray(event)),
      move: (handle, place, done) => this.move(handle, place, done),
      remove: (handle) => this.remove(handle),
      choose: (handle) => this.choose(handle),
    });
    this.overlay = h("div", { class: "scene-overlay" }, this.boundary.handles, this.seed, this.rosette.label);
    this.object.add(this.mould.object);
    this.overlay.hidden = !edited;
    this.tools.hidden = !edited;
    if (!edited) return;
    this.object.add(this.boundary.object, this.rosette.object, this.covered.object);
    this.tools.append(this.drawBoundary, this.drawHole, this.removing, this.undoing, this.clearing, this.told);
    this.seed.addEventListener("pointerdown", (event) => this.drag(event));
    this.show(values);
    this.past = [];
    this.dress();
  }

  /** Bounds of the mould, with the courses where these reach beyond it. */
  get box(): Box3 {
    return this.courses ? new Box3().copy(this.mould.box).union(this.courses.box) : this.mould.box;
  }

  /** The elevation that shows most of the mould. */
  get facing(): Direction {
    const ways: Direction[] = ["top", "front", "side"];
    return ways.reduce((best, way) => (DIRECTIONS[way].dot(this.mould.up) > DIRECTIONS[best].dot(this.mould.up) + 0.1 ? way : best));
  }

  /** Draws what the ply's values say. */
  show(values: SetupValues): void {
    if (!this.edited) return;
    const ply = values["ply"] ?? {};
    const [boundary, holes] = [ply["boundary"], ply["holes"]];
    const next = { boundary: arePoints(boundary) ? boundary : null, holes: areLoops(holes) ? holes : [] };
    const same = JSON.stringify([ply, next]) === JSON.stringify([this.values, this.outline]);
    if (!same) this.region = null;
    // What was typed is undone like what was drawn.
    if (JSON.stringify(next) !== JSON.stringify(this.outline)) this.remember();
    this.outline = next;
    this.values = ply;
    this.draw();
  }

  /** Draws what the ply covers, after its inset; null: it is not known. */
  cover(region: Region | null): void {
    this.region = region;
    const rings = (region?.rings_mm ?? []).map((ring) => ring.map((point) => new Vector3(...point).multiplyScalar(MM)));
    this.covered.show(rings.map((ring) => this.mould.trace(ring)));
    this.turn(this.origin());
    this.dress();
  }

  /** Draws the courses of a plan in place of the former ones; null: none. */
  async plan(planned: Planned | null): Promise<void> {
    const turn = ++this.planned;
    const courses = planned && (await Courses.of(planned, this.mould, (course) => this.sight.choose(course)));
    if (turn !== this.planned) {
      courses?.dispose();
      return;
    }
    this.courses?.object.removeFromParent();
    this.courses?.dispose();
    this.courses = courses;
    if (courses) {
      this.object.add(courses.object);
      this.overlay.prepend(...courses.numbers.map(([label]) => label));
    }
    this.sight.draw();
  }

  /** What the courses can be coloured by. */
  get maps(): readonly Map2D[] {
    return this.courses?.maps ?? [];
  }

  colour(by: Map2D): HTMLElement | null {
    return this.courses?.colour(by) ?? null;
  }

  select(course: number): void {
    this.courses?.select(course);
  }

  /** The course under a ray, and what is known of it there. */
  hit(raycaster: Raycaster): { course: number; words: string } | null {
    return this.busy ? null : (this.courses?.hit(raycaster) ?? null);
  }

  /** Puts a point where the mould was clicked, if a line is being drawn; whether it did. */
  click(event: PointerEvent): boolean {
    if (this.drawing === null) return false;
    const place = this.mould.hit(this.sight.ray(event));
    if (!place) {
      this.say(t("ply.beside"));
      return true;
    }
    const loop = this.drawing;
    const { left, top } = this.overlay.parentElement!.getBoundingClientRect();
    const side = this.boundary.side(event.clientX - left, event.clientY - top, (each) => this.sight.project(each));
    const points = [...(loopsOf(this.outline)[loop] ?? [])];
    const index = side?.loop === loop && points.length > 2 ? side.index + 1 : points.length;
    points.splice(index, 0, this.mould.pointOf(place));
    this.put(loop, points);
    this.choose({ loop, index });
    return true;
  }

  /** Takes a key; whether it was one of drawing. */
  press(event: KeyboardEvent): boolean {
    if (!this.edited) return false;
    if ((event.ctrlKey || event.metaKey) && event.key === "z") this.undo();
    else if (this.drawing !== null && (event.key === "Escape" || event.key === "Enter")) this.begin(null);
    else if (this.chosen && (event.key === "Delete" || event.key === "Backspace")) this.remove(this.chosen);
    else return false;
    return true;
  }

  get busy(): boolean {
    return this.drawing !== null;
  }

  /** Everything of the page that stands over a place of the scene. */
  *marks(): Iterable<[HTMLElement, Vector3 | null]> {
    if (!this.edited) return;
    yield* this.courses?.numbers ?? [];
    yield* this.boundary.marks();
    yield [this.seed, this.place];
    yield [this.rosette.label, this.rosette.tip];
  }

  retranslate(): void {
    translateAll(this.tools);
    this.draw();
  }

  dispose(): void {
    this.object.removeFromParent();
    this.mould.dispose();
    this.boundary.dispose();
    this.rosette.dispose();
    this.covered.dispose();
    this.planned++;
    this.courses?.dispose();
    this.tools.remove();
    this.overlay.remove();
  }

  /** Begins or ends the drawing of a closed line. */
  private begin(loop: Drawing): void {
    // A press of the same button again ends it.
    const open = loop !== null && this.drawing !== null && (loop === 0) === (this.drawing === 0);
    this.drawing = open ? null : loop;
    this.chosen = null;
    if (this.drawing !== null) this.sight.look(this.facing);
    this.draw();
  }

  private choose(handle: Handle): void {
    this.chosen = handle;
    this.dress();
  }

  private move(handle: Handle, place: Vector3, done: boolean): void {
    const points = [...loopsOf(this.outline)[handle.loop]!];
    points[handle.index] = this.mould.pointOf(place);
    if (done) {
      this.put(handle.loop, points);
      return;
    }
    this.boundary.show(this.with(handle.loop, points));
    this.sight.draw();
  }

  private remove({ loop, index }: Handle): void {
    const points = [...(loopsOf(this.outline)[loop] ?? [])];
    if (index >= points.length) return;
    points.splice(index, 1);
    this.chosen = points.length ? { loop, index: Math.min(index, points.length - 1) } : null;
    this.put(loop, points);
    if (this.chosen) this.boundary.focus(this.chosen);
  }

  /** The outline with other points of a closed line; a hole without any is none. */
  private with(loop: number, points: Point[]): Outline {
    if (!loop) return { ...this.outline, boundary: points.length ? points : null };
    const holes = [...this.outline.holes];
    holes[loop - 1] = points;
    return { ...this.outline, holes: holes.filter((hole) => hole.length > 0) };
  }

  private put(loop: number, points: Point[]): void {
    this.edit(this.with(loop, points));
  }

  private edit(outline: Outline): void {
    this.remember();
    this.outline = outline;
    this.tell(outline);
  }

  private remember(): void {
    const { outline, values } = this;
    this.past = [...this.past, { ...outline, seed: (values["seed"] as Point | undefined) ?? null }].slice(-MOST_UNDONE);
  }

  private undo(): void {
    const last = this.past.at(-1);
    if (!last) return;
    this.past = this.past.slice(0, -1);
    this.chosen = null;
    this.outline = { boundary: last.boundary ?? null, holes: last.holes ?? [] };
    this.tell(last);
  }

  private tell(drawn: Drawn): void {
    this.edited?.(drawn);
    this.draw();
  }

  /** Moves the seed while it is dragged. */
  private drag(event: PointerEvent): void {
    if (event.button !== 0) return;
    this.seed.setPointerCapture(event.pointerId);
    let moved: Vector3 | null = null;
    const move = (next: PointerEvent): void => {
      moved = this.mould.hit(this.sight.ray(next)) ?? moved;
      if (moved) this.turn(moved);
    };
    this.seed.addEventListener("pointermove", move);
    const end = (): void => {
      this.seed.removeEventListener("pointermove", move);
      if (!moved) return;
      this.remember();
      this.tell({ seed: this.mould.pointOf(moved) });
    };
    this.seed.addEventListener("lostpointercapture", end, { once: true });
  }

  /** Where the ply has its angle: where it says so, else in the middle of what it covers. */
  private origin(): Vector3 {
    const { seed } = this.values;
    if (this.region) return new Vector3(...this.region.seed_mm).multiplyScalar(MM);
    if (arePoints([seed])) {
      const place = this.mould.placeOf(seed as Point);
      return this.mould.above(place) ?? place;
    }
    const { boundary } = this.outline;
    if (!boundary || boundary.length < 3) return this.mould.middle();
    const middle = centroid(boundary.map((point) => this.mould.placeOf(point)), this.mould.up);
    return this.mould.above(middle) ?? this.mould.middle();
  }

  private turn(place: Vector3): void {
    const { rosette, angle_deg: angle } = this.values;
    this.place = place;
    this.rosette.show(place, arePoints([rosette]) ? new Vector3(...(rosette as Point)) : ALONG, Number(angle ?? 0));
    this.sight.draw();
  }

  private draw(): void {
    this.boundary.show(this.outline);
    this.turn(this.origin());
    this.dress();
  }

  /** Shows what can be done. */
  private dress(): void {
    const { boundary, holes } = this.outline;
    this.drawBoundary.ariaPressed = String(this.drawing === 0);
    this.drawHole.ariaPressed = String(this.drawing !== null && this.drawing > 0);
    this.removing.disabled = !this.chosen;
    this.undoing.disabled = !this.past.length;
    this.clearing.disabled = !boundary && !holes.length;
    const name = t("ply.seed", { place: this.mould.pointOf(this.place).join(", ") });
    this.seed.setAttribute("aria-label", name);
    this.seed.title = name;
    for (const element of this.boundary.handles.querySelectorAll<HTMLElement>(".scene-handle")) {
      const { loop, index } = element.dataset;
      element.classList.toggle("chosen", Number(loop) === this.chosen?.loop && Number(index) === this.chosen.index);
    }
    const area = this.region ? t("ply.area", { area: this.region.area_m2.toFixed(3) }) : "";
    this.say(this.drawing === null ? area : t(this.drawing ? "ply.hint.hole" : "ply.hint.boundary"));
  }

  private say(text: string): void {
    this.told.textContent = text;
    this.told.hidden = !text;
  }
}

/** The middle of the area of a polygon seen along a direction. */
function centroid(points: Vector3[], up: Vector3): Vector3 {
  const [origin, sum] = [points[0]!, new Vector3()];
  let whole = 0;
  for (let index = 1; index + 1 < points.length; index++) {
    const [first, second] = [points[index]!.clone().sub(origin), points[index + 1]!.clone().sub(origin)];
    const area = new Vector3().crossVectors(first, second).dot(up);
    sum.addScaledVector(first.add(second), area / 3);
    whole += area;
  }
  return Math.abs(whole) > 1e-12 ? sum.divideScalar(whole).add(origin) : origin.clone();
}

function tool(testid: string, key: string, onclick: () => void): HTMLButtonElement {
  return h("button", { type: "button", testid, t: key, tTitle: `${key}.about`, onclick });
}
