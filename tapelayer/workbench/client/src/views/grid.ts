import { Box3, BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments, Vector3 } from "three";
import { MM } from "./work";

/** The plane that a grid lies in: the floor, or upright behind what is seen from the front or from the side. */
export type Plane = "floor" | "front" | "side";

// About as many squares as fit into the height of the view, and at most as many along a side.
const SQUARES = 10;
const MOST = 80;
const STEPS = [1, 2, 5, 10];
/** Axes along which a grid runs, and the third. */
const AXES: Record<Plane, ["x" | "y", "y" | "z", "x" | "y" | "z"]> = {
  floor: ["x", "y", "z"],
  front: ["x", "z", "y"],
  side: ["y", "z", "x"],
};

/** A grid of round spacing in the machine's axes, below or behind a box. Metres. */
export class Grid {
  readonly object = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({ color: 0x8f9aa6, transparent: true, opacity: 0.35, depthWrite: false }),
  );
  /** Millimetres from line to line. */
  spacing = 0;
  private drawn = "";

  constructor() {
    this.object.frustumCulled = false;
  }

  /** Lays it below or behind a box, as fine as a view of a height in metres shows well. */
  show(plane: Plane, box: Box3, height: number): void {
    const size = box.getSize(SIZE);
    const [across, up, away] = AXES[plane];
    const spacing = roundOf(Math.max(height / SQUARES, size[across] / MOST, size[up] / MOST) / MM) * MM;
    const described = [plane, spacing, ...box.min.toArray(), ...box.max.toArray()].join(" ");
    if (described === this.drawn) return;
    this.drawn = described;
    this.spacing = Math.round(spacing / MM);
    const level = plane === "front" ? box.max[away] : box.min[away];
    const [lows, highs] = [across, up].reduce<[number[], number[]]>(
      ([low, high], axis) => [
        [...low, Math.floor(box.min[axis] / spacing - 1)],
        [...high, Math.ceil(box.max[axis] / spacing + 1)],
      ],
      [[], []],
    );
    const points: number[] = [];
    const add = (first: number, second: number): void => {
      const point = new Vector3();
      point[across] = first * spacing;
      point[up] = second * spacing;
      point[away] = level;
      points.push(...point.toArray());
    };
    for (let line = lows[0]!; line <= highs[0]!; line++) {
      add(line, lows[1]!);
      add(line, highs[1]!);
    }
    for (let line = lows[1]!; line <= highs[1]!; line++) {
      add(lows[0]!, line);
      add(highs[0]!, line);
    }
    this.object.geometry.dispose();
    this.object.geometry = new BufferGeometry();
    this.object.geometry.setAttribute("position", new BufferAttribute(Float32Array.from(points), 3));
  }
}

const SIZE = new Vector3();

/** The next 1, 2 or 5 times a power of ten that is not below a value; at least 1. */
function roundOf(value: number): number {
  const power = 10 ** Math.floor(Math.log10(Math.max(value, 1)));
  return STEPS.find((step) => step * power >= value * (1 - 1e-9))! * power;
}
