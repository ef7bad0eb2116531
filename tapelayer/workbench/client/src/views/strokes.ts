import type { Vector3 } from "three";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";

/** Lines of one colour over a surface, as wide as pixels say. Metres. */
export class Strokes {
  readonly object: LineSegments2;

  constructor(color: number, linewidth: number) {
    // The surface must not hide what is drawn on it.
    const above = { polygonOffset: true, polygonOffsetFactor: -4, polygonOffsetUnits: -64 };
    this.object = new LineSegments2(new LineSegmentsGeometry(), new LineMaterial({ color, linewidth, ...above }));
    this.object.frustumCulled = false;
    this.object.visible = false;
  }

  /** Draws lines through points. */
  show(lines: readonly (readonly Vector3[])[]): void {
    const ends: number[] = [];
    for (const line of lines) {
      for (let point = 1; point < line.length; point++) ends.push(...line[point - 1]!.toArray(), ...line[point]!.toArray());
    }
    this.object.visible = ends.length > 0;
    // A geometry keeps the number of its first lines.
    this.object.geometry.dispose();
    this.object.geometry = new LineSegmentsGeometry();
    if (ends.length) this.object.geometry.setPositions(ends);
  }

  dispose(): void {
    this.object.geometry.dispose();
    this.object.material.dispose();
  }
}
