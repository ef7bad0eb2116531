import {
  Box3,
  DirectionalLight,
  HemisphereLight,
  Matrix4,
  OrthographicCamera,
  PerspectiveCamera,
  Scene,
  Sphere,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export const DIRECTIONS = {
  iso: new Vector3(0.8, -1, 0.85),
  // The little keeps y upwards, and is far below a pixel.
  top: new Vector3(0, -1e-5, 1),
  front: new Vector3(0, -1, 0),
  side: new Vector3(1, 0, 0),
} as const;
export type Direction = keyof typeof DIRECTIONS;

// Larger than any machine, metres: elevations look from half of it before the target to half of it behind.
const DEEP = 50;
// An elevation that leaves its direction by more, radians, is one no longer.
const TURNED = 1e-3;

// Software renderers are slow per pixel, so the frame rate and the number of pixels are capped.
const FRAME_MS = 1000 / 30;
const MOVING_PIXELS = 1_500_000;
const RESTING_PIXELS = 4_000_000;
// After this long without a change the view counts as at rest; slow renderers get longer.
const REST_MS = 300;
const SLOWEST_MS = 1000;

const SEEN = new Matrix4();

/** Whether this browser supports WebGL 2. */
export function drawable(): boolean {
  return document.createElement("canvas").getContext("webgl2") !== null;
}

/**
 * A camera and its scene, redrawn only after a change. Metres, z up.
 *
 * Top, front and side are elevations, parallel and level, until the view is turned; then it is in perspective.
 */
export class View {
  readonly scene = new Scene();
  private readonly free = new PerspectiveCamera(35, 1, 0.02, 100);
  private readonly level = new OrthographicCamera(-1, 1, 1, -1, 0, DEEP);
  private readonly sun = new DirectionalLight(0xffffff, 1.9);
  private way: Vector3 | null = null;
  private towards: Direction | null = null;
  readonly controls: OrbitControls;
  private readonly renderer: WebGLRenderer;
  private readonly observer: ResizeObserver;
  private readonly sphere = new Sphere(new Vector3(), 2);
  private frame = 0;
  private rest = 0;
  private drawn = 0;
  private frames = 0;
  private lost = false;

  /**
   * @param host element that the canvas fills.
   * @param onLost called when the graphics context is lost and when it is restored.
   * @param beforeDraw updates the scene right before it is drawn; its argument says whether more frames follow soon.
   * @param busy whether something keeps moving by itself.
   */
  constructor(
    private readonly host: HTMLElement,
    readonly canvas: HTMLCanvasElement,
    onLost: (lost: boolean) => void,
    private readonly beforeDraw: (moving: boolean) => void,
    private readonly busy: () => boolean,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, powerPreference: "low-power" });
    for (const camera of [this.free, this.level]) camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.free, canvas);
    this.controls.addEventListener("change", () => {
      this.leaveElevation();
      this.draw();
    });
    this.controls.zoomToCursor = true;
    this.sun.position.set(-0.4, 0.8, 1);
    this.free.add(this.sun);
    this.scene.add(this.free, this.level, new HemisphereLight(0xffffff, 0x8a94a0, 1.6));
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.lost = true;
      onLost(true);
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.lost = false;
      onLost(false);
      this.draw();
    });
    this.observer = new ResizeObserver(() => this.draw());
    this.observer.observe(host);
  }

  /** Requests a redraw. */
  draw(): void {
    if (!this.frame) this.frame = requestAnimationFrame(this.tick);
  }

  /** The camera in use: parallel for elevations, else in perspective. */
  get camera(): PerspectiveCamera | OrthographicCamera {
    return this.way ? this.level : this.free;
  }

  /** The elevation that is shown; null for none. */
  get elevation(): Direction | null {
    return this.way && this.towards;
  }

  /** Metres in view from the bottom to the top, at the target. */
  get height(): number {
    if (this.way) return (this.level.top - this.level.bottom) / this.level.zoom;
    return 2 * this.free.position.distanceTo(this.controls.target) * Math.tan((this.free.fov * Math.PI) / 360);
  }

  /** Fits a box into the view. */
  look(direction: Direction | null, box: Box3): void {
    if (box.isEmpty()) return;
    if (direction) this.towards = direction;
    box.getBoundingSphere(this.sphere);
    const way = direction ? DIRECTIONS[direction].clone() : this.camera.position.clone().sub(this.controls.target);
    way.normalize();
    const elevation = direction ? direction !== "iso" : this.way !== null;
    const narrow = Math.min(1, this.free.aspect || 1);
    const radius = Math.max(1.05 * this.sphere.radius, 0.03);
    const distance = elevation ? DEEP / 2 : radius / (Math.sin((this.free.fov * Math.PI) / 360) * narrow);
    this.way = null;
    const camera = elevation ? this.level : this.free;
    this.controls.object = camera;
    this.controls.target.copy(this.sphere.center);
    camera.position.copy(this.sphere.center).addScaledVector(way, distance);
    if (elevation) {
      this.level.zoom = 1;
      this.frameLevel(radius / narrow);
    }
    camera.add(this.sun);
    this.controls.update();
    this.way = elevation ? way : null;
    this.draw();
  }

  /** Turns the view by angles in radians: to the left and upwards. */
  turn(left: number, up: number): void {
    this.controls.rotateLeft(left);
    this.controls.rotateUp(up);
  }

  /** Moves what is seen by pixels: to the right and down. */
  move(right: number, down: number): void {
    this.controls.pan(right, down);
  }

  /** Zooms by a factor; below 1 is nearer. */
  zoom(factor: number): void {
    const { target } = this.controls;
    if (this.way) {
      this.level.zoom /= factor;
      this.level.updateProjectionMatrix();
    } else this.free.position.sub(target).multiplyScalar(factor).add(target);
    this.draw();
  }

  /** Centres the view on a point. */
  follow(point: Vector3): void {
    this.camera.position.add(point).sub(this.controls.target);
    this.controls.target.copy(point);
  }

  dispose(): void {
    cancelAnimationFrame(this.frame);
    clearTimeout(this.rest);
    this.observer.disconnect();
    this.controls.dispose();
    this.renderer.dispose();
  }

  private readonly tick = (now: number): void => {
    this.frame = 0;
    if (now - this.drawn < FRAME_MS - 2) {
      this.draw();
      return;
    }
    const slowness = Math.min(now - this.drawn, SLOWEST_MS);
    this.drawn = now;
    this.render(true);
    clearTimeout(this.rest);
    this.rest = window.setTimeout(() => this.sharpen(), REST_MS + 2 * slowness);
  };

  /** Redraws in full detail once nothing moves. */
  private sharpen(): void {
    if (!this.frame && !this.busy()) this.render(false);
  }

  private render(moving: boolean): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (this.lost || !width || !height) return;
    const began = performance.now();
    this.beforeDraw(moving);
    const most = Math.sqrt((moving ? MOVING_PIXELS : RESTING_PIXELS) / (width * height));
    const ratio = Math.min(moving ? 1 : Math.min(devicePixelRatio, 2), most);
    this.resize(width, height, ratio);
    this.renderer.render(this.scene, this.camera);
    this.frames += 1;
    const { projectionMatrix, matrixWorldInverse } = this.camera;
    this.canvas.dataset["camera"] = SEEN.multiplyMatrices(projectionMatrix, matrixWorldInverse).elements.join(" ");
    this.canvas.dataset["projection"] = this.way ? "parallel" : "perspective";
    this.canvas.dataset["resting"] = String(!moving);
    this.canvas.dataset["frames"] = String(this.frames);
    this.canvas.dataset["drawMs"] = (performance.now() - began).toFixed(1);
  }

  private frameLevel(half: number): void {
    const { level } = this;
    [level.top, level.bottom] = [half, -half];
    [level.right, level.left] = [half * this.free.aspect, -half * this.free.aspect];
    level.updateProjectionMatrix();
  }

  /** Goes over to perspective where an elevation is turned; what is at the target keeps its size. */
  private leaveElevation(): void {
    const { free, level, way } = this;
    const { target } = this.controls;
    if (!way || level.position.clone().sub(target).normalize().distanceTo(way) < TURNED) return;
    const distance = this.height / 2 / Math.tan((free.fov * Math.PI) / 360);
    this.way = null;
    free.position.subVectors(level.position, target).setLength(distance).add(target);
    this.controls.object = free;
    free.add(this.sun);
    this.controls.update();
  }

  private resize(width: number, height: number, ratio: number): void {
    const [columns, rows] = [Math.floor(width * ratio), Math.floor(height * ratio)];
    if (this.canvas.width === columns && this.canvas.height === rows) return;
    this.renderer.setDrawingBufferSize(width, height, ratio);
    this.free.aspect = width / height;
    this.free.updateProjectionMatrix();
    this.frameLevel(this.level.top);
  }
}
