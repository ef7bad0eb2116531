import "./scene.css";
import { Box3, Raycaster, Vector2, Vector3 } from "three";
import { reach } from "../data/api";
import { h, translateAll } from "../elements";
import { Machine3D } from "./machine3d";
import { FIRST, KINDS } from "../data/kinds";
import type { Clock, CreatePanel, Kind, Made, ScenePanel, Selection, Translate } from "../data/types";
import { type Colouring, Stage } from "./stage";
import { DIRECTIONS, type Direction, drawable, View } from "./view";

// A press that moves no farther than this counts as a click, pixels.
const CLICK = 4;
const HOVER_MS = 60;
const ZOOM = 0.8;
// Sine of the view's elevation above which the head hides the work.
const STEEP = 0.8;

const NAMES = { tLabel: "scene.machine", tTitle: "scene.hands" };

/** The machine in 3D with its work so far. */
export const createScene: CreatePanel<ScenePanel> = (root, clock, t, selection) => {
  root.classList.add("scene");
  if (drawable()) return new ScenePicture(root, clock, t, selection);
  root.append(h("p", { class: "scene-message", testid: "scene-message", t: "scene.no_webgl" }));
  const nothing = (): void => {};
  return { show: nothing, clear: nothing, idle: nothing, retranslate: () => translateAll(root) };
};

class ScenePicture implements ScenePanel {
  private readonly canvas = h("canvas", { testid: "scene", tabindex: 0, role: "img", ...NAMES });
  private readonly label = h("div", { class: "scene-label", hidden: true });
  private readonly message = h("p", { class: "scene-message", testid: "scene-message", role: "status", hidden: true });
  private readonly legends = h("div", { class: "scene-legends" });
  private readonly followed = button("follow", "scene.follow", "scene.follow.title", () => this.follow());
  private readonly bare = button("hide-machine", "scene.bare-work", "scene.bare-work.title", () => this.reveal(this.bare));
  private readonly plain = button("hide-passes", "scene.no-lines", "scene.no-lines.title", () => this.reveal(this.plain));
  private readonly colouring = h(
    "select",
    { testid: "tape-colour", tTitle: "scene.colour", tLabel: "scene.colour", onchange: () => this.colour() },
    h("option", { value: "course", t: "scene.colour.course" }),
    h("option", { value: "error", t: "scene.colour.error" }),
  );
  private readonly view: View;
  private readonly raycaster = new Raycaster();
  private readonly pointer = new Vector2();
  private readonly point = new Vector3();
  private stage: Stage | null = null;
  private kind: Kind = FIRST;
  // Counts the requests, so that late answers are dropped.
  private asked = 0;
  private close = true;
  private hovering = 0;
  private pressed: PointerEvent | null = null;

  constructor(
    private readonly root: HTMLElement,
    private readonly clock: Clock,
    private readonly t: Translate,
    private readonly selection: Selection,
  ) {
    const tools = h("div", { class: "scene-tools", role: "toolbar", tLabel: "scene.machine" });
    for (const direction of Object.keys(DIRECTIONS) as Direction[]) {
      tools.append(button(`view-${direction}`, `scene.view.${direction}`, `scene.view.${direction}`, () => this.look(direction)));
    }
    tools.append(
      button("view-fit", "scene.fit", "scene.fit.title", () => this.look(null, true)),
      button("view-machine", "scene.whole", "scene.whole.title", () => this.look(null, false)),
      this.followed,
      this.bare,
      this.plain,
      this.colouring,
    );
    for (const switched of [this.followed, this.bare, this.plain]) switched.setAttribute("aria-pressed", "false");
    this.plain.hidden = true;
    this.colouring.hidden = true;
    root.append(this.canvas, tools, this.legends, this.label, this.message);
    this.view = new View(
      root,
      this.canvas,
      (lost) => this.say(lost ? t("scene.lost") : ""),
      (moving) => this.update(moving),
      () => clock.playing,
    );
    this.view.controls.addEventListener("start", () => this.leave());
    clock.onChange(() => this.view.draw());
    selection.onChange((course) => {
      this.stage?.select(course);
      this.view.draw();
    });
    this.canvas.addEventListener("pointermove", (event) => this.hover(event));
    this.canvas.addEventListener("pointerleave", () => this.leave());
    this.canvas.addEventListener("pointerdown", (event) => (this.pressed = event));
    this.canvas.addEventListener("pointerup", (event) => this.click(event));
    this.canvas.addEventListener("keydown", (event) => this.zoom(event));
  }

  show(made: Made): void {
    this.kind = made.kind;
    const parts = made.url("urdf").replace(/urdf$/, "parts/");
    void this.set(made.url("urdf"), made, async (name) => (await reach(parts + encodeURIComponent(name))).arrayBuffer());
  }

  idle(kind: Kind): void {
    this.kind = kind;
    void this.set(`/api/v1/machines/${KINDS[kind].machine}/urdf`, null, () => Promise.reject(new Error("no job")));
  }

  clear(): void {
    this.idle(this.kind);
  }

  retranslate(): void {
    translateAll(this.root);
  }

  dispose(): void {
    this.stage?.dispose();
    this.view.dispose();
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
    this.stage?.dispose();
    this.stage = stage;
    this.view.scene.add(stage.object);
    stage.select(this.selection.course);
    this.colouring.hidden = !stage.measured;
    this.plain.hidden = !stage.lined;
    this.reveal();
    this.colour();
    this.look("iso", !stage.work.isEmpty());
  }

  /** Updates everything to the clock's time. */
  private update(moving: boolean): void {
    if (!this.stage) return;
    this.stage.at(this.clock.row, this.clock.time, moving);
    this.uncover();
    if (this.followed.ariaPressed !== "true") return;
    this.stage.object.updateMatrixWorld();
    const place = this.stage.tool(this.point);
    if (place) this.view.follow(place);
  }

  /** Looks from a direction at the work or at the whole machine; either stays as it was if not given. */
  private look(direction: Direction | null, close = this.close): void {
    if (!this.stage) return;
    this.close = close;
    const { work, machine } = this.stage;
    const near = close && !work.isEmpty();
    this.view.look(direction, near ? work : new Box3().setFromObject(machine.robot));
  }

  /** Makes the machine translucent so that the work is visible; from above, the head too. */
  private uncover(): void {
    const { work, machine } = this.stage!;
    const near = this.close && !work.isEmpty();
    const { camera, controls } = this.view;
    this.point.subVectors(camera.position, controls.target).normalize();
    machine.ghost(near, near && this.point.z > STEEP);
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

  private colour(): void {
    const scale = this.stage?.colour(this.colouring.value as Colouring);
    this.legends.replaceChildren(...(scale ? [scale] : []));
    this.view.draw();
  }

  private courseAt(event: PointerEvent): number {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    this.pointer.set((2 * (event.clientX - left)) / width - 1, 1 - (2 * (event.clientY - top)) / height);
    this.raycaster.setFromCamera(this.pointer, this.view.camera);
    // Lines are hit within a few pixels.
    this.raycaster.params.Line.threshold = 0.01 * this.view.height;
    return this.stage?.hit(this.raycaster) ?? 0;
  }

  private hover(event: PointerEvent): void {
    if (event.buttons || this.hovering) return;
    // The pointer moves more often than the label needs to change.
    this.hovering = window.setTimeout(() => {
      this.hovering = 0;
      this.pointOut(event);
    }, HOVER_MS);
  }

  private pointOut(event: PointerEvent): void {
    const course = this.courseAt(event);
    this.label.hidden = course === 0;
    this.canvas.classList.toggle("pointing", course > 0);
    if (!course) return;
    const { left, top } = this.root.getBoundingClientRect();
    this.label.textContent = this.t(`player.on.${this.kind}`, { number: course });
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
    this.selection.select(this.courseAt(event));
  }

  private zoom(event: KeyboardEvent): void {
    const factor = { "+": ZOOM, "=": ZOOM, "-": 1 / ZOOM }[event.key];
    if (!factor) return;
    event.preventDefault();
    this.view.zoom(factor);
  }

  private say(text: string): void {
    this.message.textContent = text;
    this.message.hidden = !text;
  }
}

function button(testid: string, text: string, title: string, onclick: () => void): HTMLButtonElement {
  return h("button", { type: "button", testid, t: text, tTitle: title, onclick });
}
