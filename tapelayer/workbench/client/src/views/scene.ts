import "./scene.css";
import { Box3, Raycaster, Vector2, Vector3 } from "three";
import { reach, type Region } from "../data/api";
import type { Model, Unit } from "../data/model";
import { h, translateAll } from "../elements";
import { Board, type Drawn } from "./board";
import { Grid } from "./grid";
import { Machine3D } from "./machine3d";
import type { Spot } from "./spot";
import { Triad } from "./triad";
import { FIRST, KINDS } from "../data/kinds";
import type { Clock, CreateScene, Kind, Made, Planned, ScenePanel, Selection, SetupValues, Translate } from "../data/types";
import type { Map2D } from "./courses";
import { type Colouring, Stage } from "./stage";
import { inDigits } from "./legend";
import { MM } from "./work";
import { DIRECTIONS, type Direction, drawable, View } from "./view";

// A press that moves no farther than this counts as a click, pixels.
const CLICK = 4;
const HOVER_MS = 60;
const ZOOM = 0.8;
// What is looked at closely is seen with this share of the whole around it.
const CLOSE = 0.2;
// Sine of the view's elevation above which the machine hides the work.
const STEEP = 0.8;
// What a key turns, radians, and moves, as a share of the view's height.
const TURN = Math.PI / 36;
const MOVE = 0.05;
const ARROWS: Record<string, [right: number, down: number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};
const ZOOMS: Record<string, number> = { "+": ZOOM, "=": ZOOM, "-": 1 / ZOOM };

const NAMES = { tLabel: "scene.machine", tTitle: "scene.hands" };

/** The machine in 3D with its work so far. */
export const createScene: CreateScene = (root, clock, t, selection, drawn) => {
  root.classList.add("scene");
  if (drawable()) return new ScenePicture(root, clock, t, selection, drawn);
  root.append(h("p", { class: "scene-message", testid: "scene-message", t: "scene.no_webgl" }));
  const nothing = (): void => {};
  return { show: nothing, clear: nothing, idle: nothing, mould: nothing, ply: nothing, region: nothing, plan: nothing, retranslate: () => translateAll(root) };
};

class ScenePicture implements ScenePanel {
  private readonly canvas = h("canvas", { testid: "scene", tabindex: 0, role: "application", ...NAMES });
  private readonly label = h("div", { class: "scene-label", testid: "scene-label", hidden: true });
  private readonly told = h("output", { class: "scene-spot", testid: "spot", hidden: true });
  private readonly mark = h("div", { class: "scene-mark", testid: "spot-mark", hidden: true });
  private readonly nose = h("div", { class: "scene-mark tool", testid: "tool-mark", hidden: true });
  private readonly spacing = h("span", { testid: "grid-spacing" });
  private readonly triad = new Triad();
  private readonly grid = new Grid();
  private readonly message = h("p", { class: "scene-message", testid: "scene-message", role: "status", hidden: true });
  private readonly legends = h("div", { class: "scene-legends" });
  private readonly whole = button("view-machine", "scene.whole", "scene.whole.title", () => this.look(null, false));
  private readonly followed = button("follow", "scene.follow", "scene.follow.title", () => this.follow());
  private readonly bare = button("hide-machine", "scene.bare-work", "scene.bare-work.title", () => this.reveal(this.bare));
  private readonly headless = button("hide-head", "scene.headless", "scene.headless.title", () => this.reveal(this.headless));
  private readonly gridless = button("hide-grid", "scene.gridless", "scene.gridless.title", () => this.reveal(this.gridless));
  private readonly plain = button("hide-passes", "scene.no-lines", "scene.no-lines.title", () => this.reveal(this.plain));
  private readonly colouring = h("select", {
    ...{ testid: "colouring", tTitle: "scene.colour", tLabel: "scene.colour" },
    onchange: () => this.recolour(),
  });
  private readonly view: View;
  private readonly raycaster = new Raycaster();
  private readonly pointer = new Vector2();
  private readonly point = new Vector3();
  private readonly tools = h("div", { class: "scene-tools", role: "toolbar", tLabel: "scene.machine" });
  private stage: Stage | null = null;
  /** In place of a stage, while a mould is looked at before there is a program. */
  private board: Board | null = null;
  private kind: Kind = FIRST;
  // Counts the requests, so that late answers are dropped.
  private asked = 0;
  private close = true;
  private hovering = 0;
  private pointed: PointerEvent | null = null;
  private pressed: PointerEvent | null = null;
  private spot: Spot | null = null;
  /** On a mould, what was looked for there. */
  private place: Vector3 | null = null;

  constructor(
    private readonly root: HTMLElement,
    private readonly clock: Clock,
    private readonly t: Translate,
    private readonly selection: Selection,
    private readonly drawn: (drawn: Drawn) => void,
  ) {
    const { tools } = this;
    for (const direction of Object.keys(DIRECTIONS) as Direction[]) {
      tools.append(button(`view-${direction}`, `scene.view.${direction}`, `scene.view.${direction}`, () => this.look(direction)));
    }
    tools.append(
      button("view-fit", "scene.fit", "scene.fit.title", () => this.look(null, true)),
      this.whole,
      this.followed,
      this.bare,
      this.headless,
      this.plain,
      this.gridless,
      this.colouring,
    );
    for (const switched of [this.followed, this.bare, this.headless, this.plain, this.gridless]) switched.setAttribute("aria-pressed", "false");
    this.plain.hidden = true;
    this.colouring.hidden = true;
    const corner = h("div", { class: "scene-corner" }, this.told, h("div", { class: "scene-frame" }, this.spacing));
    corner.lastElementChild!.append(this.triad.element);
    translateAll(corner);
    root.append(this.canvas, this.mark, this.nose, tools, this.legends, corner, this.label, this.message);
    this.view = new View(
      root,
      this.canvas,
      (lost) => this.say(lost ? t("scene.lost") : ""),
      (moving) => this.update(moving),
      () => clock.playing,
    );
    this.view.scene.add(this.grid.object);
    this.view.controls.addEventListener("start", () => this.leave());
    clock.onChange(() => this.view.draw());
    selection.onChange((course) => {
      this.stage?.select(course);
      this.board?.select(course);
      this.view.draw();
    });
    selection.onVisit((place) => this.visit(PLACE.fromArray(place).multiplyScalar(MM)));
    this.canvas.addEventListener("pointermove", (event) => this.hover(event));
    this.canvas.addEventListener("pointerleave", () => this.leave());
    this.canvas.addEventListener("pointerdown", (event) => (this.pressed = event));
    this.canvas.addEventListener("pointerup", (event) => this.click(event));
    this.canvas.addEventListener("keydown", (event) => this.press(event));
  }

  show(made: Made): void {
    this.kind = made.kind;
    const parts = made.url("urdf").replace(/urdf$/, "parts/");
    void this.set(made.url("urdf"), made, async (name) => (await reach(parts + encodeURIComponent(name))).arrayBuffer());
  }

  idle(kind: Kind): void {
    this.kind = kind;
    const { machine } = KINDS[kind];
    if (machine) {
      void this.set(`/api/v1/machines/${machine}/urdf`, null, () => Promise.reject(new Error("no job")));
      return;
    }
    this.asked++;
    this.empty();
    this.pin(null);
    this.offer([]);
    this.colour();
    this.say(this.t("ply.import"));
  }

  clear(): void {
    this.idle(this.kind);
  }

  /** Shows a mould as it was brought in; a ply can be drawn on it. */
  mould(model: Model, unit: Unit, values: SetupValues, drawable: boolean, planned: Planned | null): void {
    this.asked++;
    this.say("");
    const sight = {
      ray: (event: MouseEvent) => this.cast(event),
      project: (place: Vector3) => this.pixel(place),
      look: (direction: Direction) => this.look(direction),
      choose: (course: number) => this.selection.select(course),
      draw: () => {
        this.canvas.classList.toggle("drawing", this.board?.busy ?? false);
        this.view.draw();
      },
    };
    const board = new Board(model, unit, sight, drawable ? this.drawn : null, values);
    this.empty();
    this.board = board;
    this.view.scene.add(board.object);
    this.tools.after(board.tools, board.overlay);
    this.pin(null);
    this.offer([]);
    this.colour();
    for (const each of this.ofMachines) each.hidden = true;
    this.look("iso", true);
    if (planned) this.plan(planned);
  }

  plan(planned: Planned | null): void {
    const { board } = this;
    this.place = null;
    board?.plan(planned).then(
      () => {
        if (board !== this.board) return;
        board.select(this.selection.course);
        this.offer(board.maps, "plan.map");
        this.colour();
      },
      (error: unknown) => this.say(this.t("scene.failed", { reason: String(error) })),
    );
  }

  region(region: Region | null): void {
    this.board?.cover(region);
  }

  ply(values: SetupValues): void {
    this.board?.show(values);
  }

  retranslate(): void {
    translateAll(this.root);
    this.board?.retranslate();
    this.colour();
    this.pin(this.spot);
  }

  dispose(): void {
    this.empty();
    this.view.dispose();
  }

  /** The buttons that there must be a machine for. */
  private get ofMachines(): HTMLElement[] {
    return [this.followed, this.bare, this.headless, this.plain, this.whole];
  }

  private empty(): void {
    this.stage?.dispose();
    this.board?.dispose();
    this.stage = null;
    this.board = null;
    this.place = null;
    this.canvas.classList.remove("drawing");
  }

  private async set(urdf: string, made: Made | null, mesh: (name: string) => Promise<ArrayBuffer>): Promise<void> {
    const asked = ++this.asked;
    const current = (): boolean => asked === this.asked;
    const missing: string[] = [];
    try {
      const text = await (await reach(urdf)).text();
      const machine = await Machine3D.of(text, mesh, (name, reason) => missing.push(this.t("scene.mesh", { name, reason })));
      const stage = new Stage(machine, made);
      await stage.furnish();
      if (current()) this.enter(stage);
      else stage.dispose();
      if (current()) this.say(missing.join("\n"));
    } catch (error) {
      if (current()) this.say(this.t("scene.failed", { reason: error instanceof Error ? error.message : String(error) }));
    }
  }

  private enter(stage: Stage): void {
    this.empty();
    this.stage = stage;
    this.view.scene.add(stage.object);
    this.pin(null);
    stage.select(this.selection.course);
    this.offer(stage.colourings);
    for (const each of this.ofMachines) each.hidden = false;
    this.plain.hidden = !stage.lined;
    this.reveal();
    this.colour();
    this.look("iso", !stage.work.isEmpty());
  }

  /** Updates everything to the clock's time. */
  private update(moving: boolean): void {
    if (this.board) {
      this.measure();
      for (const [mark, place] of this.board.marks()) this.put(mark, place);
      this.put(this.mark, this.place);
      this.put(this.nose, null);
    }
    if (!this.stage) return;
    this.stage.at(this.clock.row, this.clock.time, moving);
    this.stage.object.updateMatrixWorld();
    const shown = this.uncover(moving);
    const place = this.stage.tool(this.point);
    if (place && this.followed.ariaPressed === "true") this.view.follow(place);
    this.measure();
    this.put(this.nose, shown ? null : place);
    this.put(this.mark, this.spot?.place ?? null);
  }

  /** Draws the grid and the directions as the camera sees them. */
  private measure(): void {
    const { view, grid } = this;
    const { elevation } = view;
    grid.object.visible = this.gridless.ariaPressed !== "true";
    grid.show(elevation === "front" || elevation === "side" ? elevation : "floor", this.seen(), view.height);
    this.spacing.textContent = grid.object.visible ? this.t("scene.spacing", { spacing: grid.spacing }) : "";
    this.triad.show(view.camera);
  }

  /** What the view is about: the work if it is near, else the machine. */
  private seen(): Box3 {
    if (this.board) return this.board.box;
    const { work, machine } = this.stage!;
    return this.near ? work : new Box3().setFromObject(machine.robot);
  }

  private get near(): boolean {
    return this.close && this.stage !== null && !this.stage.work.isEmpty();
  }

  /** Puts a mark over a place in the scene. */
  private put(mark: HTMLElement, place: Vector3 | null): void {
    mark.hidden = !place;
    if (!place) return;
    const [x, y] = this.pixel(place);
    mark.hidden = PLACE.z > 1;
    mark.style.transform = `translate(${x}px, ${y}px)`;
  }

  /** Where a place is seen, pixels from the left and the top; leaves its depth in `PLACE`. */
  private pixel(place: Vector3): [number, number] {
    const { clientWidth, clientHeight } = this.root;
    this.view.camera.updateMatrixWorld();
    const { x, y } = PLACE.copy(place).project(this.view.camera);
    return [((1 + x) / 2) * clientWidth, ((1 - y) / 2) * clientHeight];
  }

  /** Looks from a direction at the work or at the whole machine; either stays as it was if not given. */
  private look(direction: Direction | null, close = this.close): void {
    if (!this.stage && !this.board) return;
    this.close = close;
    this.view.look(direction, this.seen());
  }

  /**
   * Draws the machine faintly, and not at all from above, so that the work is visible; whether the head is drawn.
   *
   * What is translucent costs most by far, so it is left out during motion.
   */
  private uncover(moving: boolean): boolean {
    const { camera, controls } = this.view;
    const above = this.near && PLACE.subVectors(camera.position, controls.target).normalize().z > STEEP;
    const head = !above && this.headless.ariaPressed !== "true";
    const frame = !this.near ? "solid" : above || moving ? "hidden" : "ghost";
    this.stage!.machine.dress(frame, head ? "solid" : "hidden");
    this.canvas.dataset["frame"] = frame;
    return head && this.bare.ariaPressed !== "true";
  }

  private follow(): void {
    this.followed.ariaPressed = String(this.followed.ariaPressed !== "true");
    this.view.draw();
  }

  /** Shows what is not hidden, after a press of a button that hides. */
  private reveal(pressed?: HTMLButtonElement): void {
    if (pressed) pressed.ariaPressed = String(pressed.ariaPressed !== "true");
    this.stage?.reveal(this.bare.ariaPressed !== "true", this.plain.ariaPressed !== "true");
    this.view.draw();
  }

  /** Offers what the work can be coloured by; what was chosen stays if it can. */
  private offer(colourings: readonly (Colouring | Map2D)[], named = "scene.colour"): void {
    const { value } = this.colouring;
    this.colouring.replaceChildren(...colourings.map((each) => h("option", { value: each, t: `${named}.${each}` })));
    this.colouring.value = colourings.find((each) => each === value) ?? colourings[0] ?? "";
    this.colouring.hidden = colourings.length < 2;
  }

  private recolour(): void {
    // What was measured at the pinned place is told by the colouring.
    this.pin(null);
    this.colour();
  }

  private colour(): void {
    const by = this.colouring.value;
    const scale = this.board ? this.board.colour(by as Map2D) : this.stage?.colour(by as Colouring, () => this.view.draw());
    this.legends.replaceChildren(...(scale ? [scale] : []));
    this.view.draw();
  }

  /** The ray under the pointer. */
  private cast(event: MouseEvent): Raycaster {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    this.pointer.set((2 * (event.clientX - left)) / width - 1, 1 - (2 * (event.clientY - top)) / height);
    this.raycaster.setFromCamera(this.pointer, this.view.camera);
    return this.raycaster;
  }

  private spotAt(event: PointerEvent): Spot | null {
    return this.stage?.hit(this.cast(event), this.clock.time) ?? null;
  }

  private hover(event: PointerEvent): void {
    this.pointed = event;
    if (event.buttons || this.hovering) return;
    // The pointer moves more often than the label needs to change.
    this.hovering = window.setTimeout(() => {
      this.hovering = 0;
      this.pointOut(this.pointed ?? event);
    }, HOVER_MS);
  }

  private pointOut(event: PointerEvent): void {
    const met = this.board?.hit(this.cast(event)) ?? null;
    const spot = this.spotAt(event);
    this.label.hidden = !spot && !met;
    this.canvas.classList.toggle("pointing", Boolean(spot?.course ?? met));
    if (!spot && !met) return;
    const { left, top } = this.root.getBoundingClientRect();
    this.label.textContent = met ? met.words : this.words(spot!);
    this.label.style.transform = `translate(${event.clientX - left + 14}px, ${event.clientY - top + 14}px)`;
  }

  private leave(): void {
    clearTimeout(this.hovering);
    this.hovering = 0;
    this.label.hidden = true;
  }

  private click(event: PointerEvent): void {
    const from = this.pressed;
    this.pressed = null;
    if (!from || event.button !== 0) return;
    if (Math.hypot(event.clientX - from.clientX, event.clientY - from.clientY) > CLICK) return;
    if (this.board) {
      if (!this.board.click(event)) this.selection.select(this.board.hit(this.cast(event))?.course ?? 0);
      return;
    }
    const spot = this.spotAt(event);
    const made = spot?.course ? spot : null;
    this.pin(made);
    if (made) {
      this.clock.pause();
      this.clock.seekTime(made.time);
    }
    this.selection.select(made?.course ?? 0);
  }

  /** Looks at a place closely, from where the view looks now. */
  private visit(place: Vector3): void {
    if (!this.board) return;
    this.place = place.clone();
    const half = CLOSE * this.board.box.getSize(PLACE).length();
    this.view.look(null, new Box3().setFromCenterAndSize(this.place, PLACE.setScalar(half)));
  }

  /** Marks a place and tells what it is. */
  private pin(spot: Spot | null): void {
    this.spot = spot;
    this.told.hidden = !spot;
    this.told.textContent = spot ? this.words(spot) : "";
    this.view.draw();
  }

  /** What a place is, a line each: where on the course or pass, in which block, and what is measured there. */
  private words({ course, point, along, across, time, measured }: Spot): string {
    const lines: string[] = [];
    if (course) {
      const motion = this.stage!.motion!;
      const row = motion.rowAt(time);
      const side = across < 0 ? "scene.spot.right" : "scene.spot.left";
      lines.push(
        this.t(`scene.spot.${KINDS[this.kind].part}`, { course, point }),
        this.t(side, { along: along.toFixed(1), across: Math.abs(across).toFixed(1) }),
        this.t("scene.spot.block", { block: motion.block(row), line: motion.lines[row]! }),
      );
    }
    if (measured) lines.push(this.t(`scene.spot.${measured.what}`, { value: inDigits(measured.value) }));
    return lines.join("\n");
  }

  /** Turns, moves and zooms by keys. */
  private press(event: KeyboardEvent): void {
    if (this.board?.press(event)) {
      event.preventDefault();
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const [factor, arrow] = [ZOOMS[event.key], ARROWS[event.key]];
    if (factor) this.view.zoom(factor);
    else if (arrow && event.shiftKey) this.view.move(...shares(arrow, MOVE * this.root.clientHeight));
    else if (arrow) this.view.turn(...shares(arrow, TURN));
    else if (event.key === "Home") this.look("iso", this.near);
    else return;
    event.preventDefault();
  }

  private say(text: string): void {
    this.message.textContent = text;
    this.message.hidden = !text;
  }
}

const PLACE = new Vector3();

const shares = ([right, down]: [number, number], size: number): [number, number] => [right * size, down * size];

function button(testid: string, text: string, title: string, onclick: () => void): HTMLButtonElement {
  return h("button", { type: "button", testid, t: text, tTitle: title, onclick });
}
