import { Group, Vector3 } from "three";
import { h } from "../elements";
import type { Mould } from "./mould";
import { Strokes } from "./strokes";

const DEG = Math.PI / 180;
// Lengths as shares of the mould's size.
const ARM = 0.13;
const TIP = 0.025;
const ARC = 0.07;
// The arc has a point every so many radians.
const STEP = 3 * DEG;

/** The direction that angles are measured from, and that of the ply, at the seed on the mould. */
export class Rosette {
  readonly object = new Group();
  /** Says the angle at the arrow's tip. */
  readonly label = h("span", { class: "scene-angle", testid: "angle" });
  /** Where the label stands; null where nothing is drawn. */
  tip: Vector3 | null = null;
  private readonly zero = new Strokes(0x33414e, 2);
  private readonly arrow = new Strokes(0xe07b00, 4);

  constructor(private readonly mould: Mould) {
    this.object.add(this.zero.object, this.arrow.object);
  }

  /** Draws it at a place; nothing where the rosette is along the normal. */
  show(seed: Vector3, rosette: Vector3, angle: number): void {
    const normal = this.mould.normal(seed);
    const zero = rosette.clone().addScaledVector(normal, -rosette.dot(normal));
    const drawn = zero.length() > 1e-6 && Number.isFinite(angle);
    if (!drawn) {
      this.tip = null;
      for (const strokes of [this.zero, this.arrow]) strokes.show([]);
      return;
    }
    zero.normalize();
    const left = new Vector3().crossVectors(normal, zero);
    const way = (turn: number): Vector3 => zero.clone().multiplyScalar(Math.cos(turn)).addScaledVector(left, Math.sin(turn));
    const size = this.mould.size;
    const at = (turn: number, share: number): Vector3 => seed.clone().addScaledVector(way(turn), share * size);
    const turn = angle * DEG;
    const steps = Math.max(1, Math.ceil(Math.abs(turn) / STEP));
    const arc = Array.from({ length: steps + 1 }, (_, step) => at((turn * step) / steps, ARC));
    const tip = at(turn, ARM);
    const barb = (side: number): Vector3 => tip.clone().addScaledVector(way(turn + side * 150 * DEG), TIP * size);
    this.zero.show([[seed, at(0, ARM)], arc]);
    this.arrow.show([[seed, tip], [barb(1), tip, barb(-1)]]);
    this.tip = tip;
    this.label.textContent = `${angle}°`;
  }

  dispose(): void {
    for (const strokes of [this.zero, this.arrow]) strokes.dispose();
  }
}
