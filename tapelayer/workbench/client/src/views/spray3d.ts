import Delaunator from "delaunator";
import {
  BufferAttribute,
  BufferGeometry,
  CircleGeometry,
  ConeGeometry,
  DoubleSide,
  DynamicDrawUsage,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  Triangle,
  Vector3,
} from "three";
import type { Raycaster } from "three";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";
import { BARE, BEYOND, COAT, linear, placeOf, SPEEDS, UNDER } from "./legend";
import type { Machine3D } from "./machine3d";
import { lowerBound, type Motion } from "./motion";
import type { Table } from "../data/types";

const MM = 1e-3;
// The colour scale goes from its centre less this share to its centre and this share, unless set otherwise.
const SPAN = 0.2;
// Less than this share of the mean is the far edge of a spot rather than a coat.
const TRACE = 0.01;
// Samples this many times farther apart than usual are separated by a hole or a step.
const FARTHEST = 3;
// Width of a line that tells something by its colour, pixels.
const WIDTH = 4;
const SHADES = linear(COAT);
const PACES = linear(SPEEDS);
const [NONE, LITTLE, MUCH] = [linear(BARE), linear(UNDER), linear(BEYOND)];

/** The growing coat on the part. Metres, in the machine's axes. */
export class Coat {
  readonly object: Mesh<BufferGeometry>;
  /** Mean thickness of the finished coat, in the table's unit. */
  readonly mean: number;
  /** Middle of the colour scale, in the table's unit, and the share of it up to which the scale goes on both sides. */
  centre: number;
  span = SPAN;
  private readonly colours: BufferAttribute;
  private readonly thickness: Float32Array;
  private shown = Number.NaN;

  constructor(private readonly table: Table) {
    const geometry = new BufferGeometry();
    const points = pointsOf(table);
    this.colours = new BufferAttribute(new Uint8Array(3 * table.rows), 3, true).setUsage(DynamicDrawUsage);
    geometry.setAttribute("position", new BufferAttribute(points, 3));
    geometry.setAttribute("color", this.colours);
    geometry.setIndex(new BufferAttribute(facetsOf(points), 1));
    geometry.computeVertexNormals();
    const material = new MeshLambertMaterial({
      ...{ vertexColors: true, side: DoubleSide },
      // The lines of the passes must stay visible on the surface.
      ...{ polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 8 },
    });
    this.object = new Mesh(geometry, material);
    this.object.frustumCulled = false;
    let sum = 0;
    for (let row = 0; row < table.rows; row++) sum += this.at(row, table.times.length - 1);
    this.mean = sum / table.rows;
    this.centre = this.mean;
    this.thickness = new Float32Array(table.rows);
  }

  get low(): number {
    return (1 - this.span) * this.centre;
  }

  get high(): number {
    return (1 + this.span) * this.centre;
  }

  /** Lays the colour scale around a thickness; the mean without one. */
  scale(centre: number | null, span: number): void {
    this.centre = centre ?? this.mean;
    this.span = span;
    this.paint();
  }

  get unit(): string {
    return this.table.unit;
  }

  /** Colours the part by the thickness at a time. */
  show(time_s: number): void {
    if (time_s === this.shown) return;
    this.shown = time_s;
    const { times, rows } = this.table;
    const next = Math.min(lowerBound(times, time_s), times.length - 1);
    const before = Math.max(next - 1, 0);
    const span = times[next]! - times[before]!;
    const share = span > 0 ? Math.min(Math.max((time_s - times[before]!) / span, 0), 1) : 1;
    for (let row = 0; row < rows; row++) {
      const begin = this.at(row, before);
      this.thickness[row] = begin + (this.at(row, next) - begin) * share;
    }
    this.paint();
  }

  /** Where a ray hits it, its normal there, and the thickness that is shown there. */
  hit(raycaster: Raycaster): { place: Vector3; distance: number; normal: Vector3; value: number } | null {
    const [met] = raycaster.intersectObject(this.object, false);
    if (!met?.face) return null;
    const { a, b, c, normal } = met.face;
    const points = this.object.geometry.getAttribute("position") as BufferAttribute;
    for (const [corner, row] of [[A, a], [B, b], [C, c]] as const) corner.fromBufferAttribute(points, row);
    if (!Triangle.getBarycoord(met.point, A, B, C, SHARES)) return null;
    const value = SHARES.x * this.thickness[a]! + SHARES.y * this.thickness[b]! + SHARES.z * this.thickness[c]!;
    return { place: met.point, distance: met.distance, normal, value };
  }

  dispose(): void {
    this.object.geometry.dispose();
    (this.object.material as MeshLambertMaterial).dispose();
  }

  private paint(): void {
    const colours = this.colours.array;
    this.thickness.forEach((thickness, row) => {
      const [shades, place] = this.shade(thickness);
      for (let part = 0; part < 3; part++) colours[3 * row + part] = shades[place + part]!;
    });
    this.colours.needsUpdate = true;
  }

  /** Colours that a thickness has its own among, and where. */
  private shade(thickness: number): [Uint8Array, number] {
    if (this.bare(thickness)) return [NONE, 0];
    if (thickness < this.low) return [LITTLE, 0];
    if (thickness > this.high) return [MUCH, 0];
    return [SHADES, placeOf(thickness - this.low, this.high - this.low)];
  }

  /** Whether a thickness is none to speak of. */
  bare(thickness: number): boolean {
    return !(thickness > TRACE * this.mean);
  }

  /** Thickness of a sample at a moment. */
  private at(row: number, moment: number): number {
    return this.table.data[row * this.table.columns.length + 3 + moment]!;
  }
}

const [A, B, C, SHARES] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];

/** Points (n, 3) in metres of a table whose first columns are x, y and z in mm. */
export function pointsOf({ rows, columns, data }: Table): Float32Array {
  const points = new Float32Array(3 * rows);
  for (let row = 0; row < rows; row++) {
    for (let part = 0; part < 3; part++) points[3 * row + part] = data[row * columns.length + part]! * MM;
  }
  return points;
}

/** Triangles between the samples of a surface in plan view, except across holes and steps. */
function facetsOf(points: Float32Array): Uint32Array {
  const plan = new Float64Array((2 * points.length) / 3);
  for (let row = 0; row < plan.length / 2; row++) plan.set(points.subarray(3 * row, 3 * row + 2), 2 * row);
  const { triangles } = new Delaunator(plan);
  const longest = new Float64Array(triangles.length / 3);
  for (let facet = 0; facet < longest.length; facet++) {
    for (let corner = 0; corner < 3; corner++) {
      const [a, b] = [3 * triangles[3 * facet + corner]!, 3 * triangles[3 * facet + ((corner + 1) % 3)]!];
      const side = Math.hypot(points[a]! - points[b]!, points[a + 1]! - points[b + 1]!, points[a + 2]! - points[b + 2]!);
      longest[facet] = Math.max(longest[facet]!, side);
    }
  }
  const usual = Float64Array.from(longest).sort()[longest.length >> 1] ?? 0;
  return triangles.filter((_, corner) => longest[Math.floor(corner / 3)]! <= FARTHEST * usual);
}

/** The spray: a cone from the nozzle to the spot, or the brush if they touch. Metres. */
export function sprayCone(standoff: number, spot: number): Mesh<BufferGeometry> {
  const geometry = standoff > 0 ? new ConeGeometry(spot / 2, standoff, 32, 1, true) : new CircleGeometry(spot / 2, 32);
  if (standoff > 0) geometry.rotateX(Math.PI / 2).translate(0, 0, standoff / 2);
  const look = { color: 0xff8c1a, transparent: true, opacity: 0.45, side: DoubleSide, depthWrite: false };
  return new Mesh(geometry, new MeshBasicMaterial(look));
}

/** A place on a pass, in seconds, and how far to the left of it another place is, metres. */
export interface Near {
  pass: number;
  time: number;
  across: number;
}

/** Lines along which the gun sprays, between rows with the arc on. */
export class Passes {
  readonly object = new Group();
  private readonly lines: LineSegments<BufferGeometry, LineBasicMaterial>;
  private readonly chosen: LineSegments<BufferGeometry, LineBasicMaterial>;
  private readonly coloured = new LineSegments2(
    new LineSegmentsGeometry(),
    new LineMaterial({
      ...{ linewidth: WIDTH, vertexColors: true },
      // The coarsened part may lie over the passes.
      ...{ polygonOffset: true, polygonOffsetFactor: -6, polygonOffsetUnits: -128 },
    }),
  );
  private readonly places: Float32Array;
  /** Row at which each segment begins and that at which it ends. */
  private readonly lit: number[] = [];
  /** Seconds at which each segment is sprayed. */
  private readonly ends: Float32Array;

  constructor(
    machine: Machine3D,
    private readonly motion: Motion,
  ) {
    const places = machine.path("P", motion);
    this.places = places;
    const { lit } = this;
    for (let row = 1; row < motion.rows; row++) {
      if (motion.isOn("arc", row - 1)) lit.push(row - 1, row);
    }
    this.ends = Float32Array.from({ length: lit.length / 2 }, (_, segment) => motion.times[lit[2 * segment + 1]!]!);
    this.coloured.visible = false;
    const position = new BufferAttribute(places, 3);
    const lines = new BufferGeometry().setAttribute("position", position).setIndex(lit);
    this.lines = new LineSegments(lines, new LineBasicMaterial({ color: 0x5b6b7a, transparent: true, opacity: 0.7 }));
    const chosen = new BufferGeometry().setAttribute("position", position).setIndex(lit);
    this.chosen = new LineSegments(chosen, new LineBasicMaterial({ color: 0xf08c00 }));
    this.chosen.renderOrder = 1;
    this.object.add(this.lines, this.coloured, this.chosen);
    for (const child of this.object.children) child.frustumCulled = false;
    this.select(0);
  }

  /** Highlights a pass; 0 for none. */
  select(number: number): void {
    const lit = this.chosen.geometry.index!;
    const { courses } = this.motion;
    let [first, end] = [0, 0];
    for (let value = 1; value < lit.count; value += 2) {
      if (courses[lit.getX(value)] !== number) continue;
      if (!end) first = value - 1;
      end = value + 1;
    }
    this.chosen.visible = number > 0 && end > first;
    this.chosen.geometry.setDrawRange(first, end - first);
  }

  /** Colours what is sprayed by a speed at each time, on a scale that ends at `most`; null: leaves it plain. */
  colourBy(speed: ((time_s: number) => number) | null, most: number): void {
    this.coloured.visible = speed !== null && this.lit.length > 0;
    if (!speed || !this.lit.length) return;
    const [ends, colours] = [new Float32Array(3 * this.lit.length), new Float32Array(3 * this.lit.length)];
    this.lit.forEach((row, end) => {
      const place = placeOf(speed(this.motion.times[row]!), most);
      for (let part = 0; part < 3; part++) {
        ends[3 * end + part] = this.places[3 * row + part]!;
        colours[3 * end + part] = PACES[place + part]! / 255;
      }
    });
    this.coloured.geometry.setPositions(ends).setColors(colours);
  }

  /** Colours no more than what is sprayed by a time. */
  show(time_s: number): void {
    let sprayed = lowerBound(this.ends, time_s);
    while (sprayed < this.ends.length && this.ends[sprayed]! <= time_s) sprayed += 1;
    this.coloured.geometry.instanceCount = sprayed;
  }

  /**
   * The nearest place of the passes sprayed by a time, at most `most` metres off; of equally near ones the last.
   *
   * @param normal of the surface at the point: seen against it, what is across lies to the left of the pass.
   */
  near(point: Vector3, normal: Vector3, time_s: number, most: number): Near | null {
    const lit = this.lines.geometry.index!;
    const { times, courses } = this.motion;
    let found: Near | null = null;
    for (let value = 0; value < lit.count; value += 2) {
      const [before, row] = [lit.getX(value), lit.getX(value + 1)];
      const [begin, end] = [times[before]!, times[row]!];
      if (begin > time_s) break;
      A.fromArray(this.places, 3 * before);
      B.fromArray(this.places, 3 * row).sub(A);
      C.subVectors(point, A);
      const sprayed = end > time_s ? (time_s - begin) / (end - begin) : 1;
      const share = Math.min(Math.max(C.dot(B) / Math.max(B.lengthSq(), 1e-12), 0), sprayed);
      const distance = C.addScaledVector(B, -share).length();
      if (!(distance <= (found ? Math.abs(found.across) : most))) continue;
      const left = SHARES.crossVectors(normal, B).dot(C) >= 0;
      const time = begin + (end - begin) * share;
      found = { pass: courses[row]!, time, across: left ? distance : -distance };
    }
    return found;
  }

  dispose(): void {
    for (const line of [this.lines, this.coloured, this.chosen]) {
      line.geometry.dispose();
      line.material.dispose();
    }
  }
}
