import { Box3, DirectionalLight, HemisphereLight, PerspectiveCamera, Scene, Sphere, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export const DIRECTIONS = {
  iso: new Vector3(0.8, -1, 0.85),
  top: new Vector3(0, -0.001, 1),
  front: new Vector3(0, -1, 0.12),
  side: new Vector3(1, 0, 0.12),
} as const;
export type Direction = keyof typeof DIRECTIONS;

// Software renderers are slow per pixel, so the frame rate and the number of pixels are capped.
const FRAME_MS = 1000 / 30;
const MOVING_PIXELS = 1_500_000;
const RESTING_PIXELS = 4_000_000;
// After this long without a change the view counts as at rest; slow renderers get longer.
const REST_MS = 300;
const SLOWEST_MS = 1000;

/** Whether this browser supports WebGL 2. */
export function drawable(): boolean {
  return document.createElement("canvas").getContext("webgl2") !== null;
}

/** A camera and its scene, redrawn only after a change. Metres, z up. */
export class View {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(35, 1, 0.02, 100);
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
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.draw());
    this.controls.zoomToCursor = true;
    const sun = new DirectionalLight(0xffffff, 1.9);
    sun.position.set(-0.4, 0.8, 1);
    this.camera.add(sun);
    this.scene.add(this.camera, new HemisphereLight(0xffffff, 0x8a94a0, 1.6));
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

  /** Fits a box into the view. */
  look(direction: Direction | null, box: Box3): void {
    if (box.isEmpty()) return;
    box.getBoundingSphere(this.sphere);
    const way = direction ? DIRECTIONS[direction].clone() : this.camera.position.clone().sub(this.controls.target);
    const narrow = Math.min(1, this.camera.aspect || 1);
    const distance = (1.05 * this.sphere.radius) / (Math.sin((this.camera.fov * Math.PI) / 360) * narrow);
    this.controls.target.copy(this.sphere.center);
    this.camera.position.copy(this.sphere.center).addScaledVector(way.normalize(), Math.max(distance, 0.1));
    this.controls.update();
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
    this.canvas.dataset["frames"] = String(this.frames);
    this.canvas.dataset["drawMs"] = (performance.now() - began).toFixed(1);
  }

  private resize(width: number, height: number, ratio: number): void {
    const [columns, rows] = [Math.floor(width * ratio), Math.floor(height * ratio)];
    if (this.canvas.width === columns && this.canvas.height === rows) return;
    this.renderer.setDrawingBufferSize(width, height, ratio);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }
}
