import {
  Box3,
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshLambertMaterial,
  Vector3,
} from "three";
import type { Raycaster } from "three";
import { toCreasedNormals } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import { type Model, type Unit, UNITS } from "../data/model";
import type { Point } from "../data/outline";
import { MM } from "./work";

// Edges sharper than this are shaded as sharp, radians; of more facets every edge is.
const CREASE = 0.6;
const MOST_CREASED = 60_000;
// Of more facets the edge is not looked for.
const MOST_EDGED = 200_000;
// Where facets face one side by less than this share of their area, the mould's z is its upward direction.
const ONE_SIDED = 0.5;
// A line is draped in steps of this share of the mould's size.
const STEP = 1 / 150;
const MOST_CELLS = 400;
const MICROMETRE = 1e-6;

/** A mould as it was brought in, and its surface seen from above. Metres, in the mould's axes. */
export class Mould {
  readonly object = new Group();
  readonly box = new Box3();
  /** Out of the surface: the mean normal of its facets, unit. */
  readonly up: Vector3;
  readonly size: number;
  private readonly mesh: Mesh<BufferGeometry, MeshLambertMaterial>;
  private readonly plan: Plan;
  /** Metres in its unit. */
  private readonly scale: number;
  private readonly digits: number;

  constructor(model: Model, unit: Unit) {
    this.scale = UNITS[unit] * MM;
    // To the micrometre.
    this.digits = Math.ceil(Math.log10(this.scale / MICROMETRE) - 1e-9);
    const corners = model.corners.map((value) => value * this.scale);
    const facets = corners.length / 9;
    const soup = new BufferGeometry().setAttribute("position", new BufferAttribute(corners, 3));
    const geometry = facets > MOST_CREASED ? soup : toCreasedNormals(soup, CREASE);
    if (geometry === soup) soup.computeVertexNormals();
    const look = { color: 0xa9b6c2, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: 3, polygonOffsetUnits: 16 };
    this.mesh = new Mesh(geometry, new MeshLambertMaterial(look));
    this.object.add(this.mesh);
    if (facets <= MOST_EDGED) this.object.add(edgeOf(corners));
    this.box.setFromObject(this.mesh);
    this.size = this.box.getSize(new Vector3()).length();
    this.up = upwards(corners);
    this.plan = new Plan(corners, this.up);
  }

  placeOf(point: Point): Vector3 {
    return new Vector3(...point).multiplyScalar(this.scale);
  }

  pointOf(place: Vector3): Point {
    // Without a sign on zero.
    return place.toArray().map((value) => Number((value / this.scale).toFixed(this.digits)) + 0) as Point;
  }

  /** Where a ray hits it. */
  hit(raycaster: Raycaster): Vector3 | null {
    return raycaster.intersectObject(this.mesh, false)[0]?.point ?? null;
  }

  /** The place of the surface above or below a place; null beside the mould. */
  above(place: Vector3): Vector3 | null {
    return this.plan.above(place);
  }

  /** The outward normal at a place of the surface, unit. */
  normal(place: Vector3): Vector3 {
    return this.plan.normal(place);
  }

  /** A straight line in plan, laid upon the surface; straight where there is none. */
  drape(from: Vector3, to: Vector3): Vector3[] {
    const steps = Math.max(2, Math.ceil(from.distanceTo(to) / (this.size * STEP)));
    return Array.from({ length: steps + 1 }, (_, step) => {
      const place = new Vector3().lerpVectors(from, to, step / steps);
      return this.above(place) ?? place;
    });
  }

  /** A closed line through points, laid upon the surface. */
  trace(ring: Vector3[]): Vector3[] {
    return ring.flatMap((point, index) => this.drape(point, ring[(index + 1) % ring.length]!));
  }

  /** The middle of the surface, weighted by area in plan. */
  middle(): Vector3 {
    const place = this.plan.middle();
    return this.above(place) ?? this.plan.nearest(place);
  }

  dispose(): void {
    for (const child of this.object.children as (Mesh | LineSegments)[]) {
      child.geometry.dispose();
      (child.material as MeshLambertMaterial).dispose();
    }
  }
}

const [A, B, C, FIRST, SECOND] = [new Vector3(), new Vector3(), new Vector3(), new Vector3(), new Vector3()];

function facetOf(corners: Float32Array, facet: number): void {
  [A, B, C].forEach((corner, index) => corner.fromArray(corners, 9 * facet + 3 * index));
}

function upwards(corners: Float32Array): Vector3 {
  const sum = new Vector3();
  let area = 0;
  for (let facet = 0; facet < corners.length / 9; facet++) {
    facetOf(corners, facet);
    FIRST.subVectors(B, A).cross(SECOND.subVectors(C, A));
    sum.add(FIRST);
    area += FIRST.length();
  }
  return sum.length() > ONE_SIDED * area ? sum.normalize() : new Vector3(0, 0, 1);
}

/** The sides of facets that no other facet has. */
function edgeOf(corners: Float32Array): LineSegments {
  const sides = new Map<string, number | null>();
  const key = (corner: number): string => corners.subarray(3 * corner, 3 * corner + 3).join(" ");
  for (let first = 0; first < corners.length / 3; first += 3) {
    const keys = [key(first), key(first + 1), key(first + 2)];
    for (let side = 0; side < 3; side++) {
      const [one, other] = [keys[side]!, keys[(side + 1) % 3]!];
      const name = one < other ? `${one},${other}` : `${other},${one}`;
      sides.set(name, sides.has(name) ? null : 3 * (first / 3) + side);
    }
  }
  const ends: number[] = [];
  for (const side of sides.values()) {
    if (side === null) continue;
    const next = side % 3 === 2 ? side - 2 : side + 1;
    ends.push(...corners.subarray(3 * side, 3 * side + 3), ...corners.subarray(3 * next, 3 * next + 3));
  }
  const geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(Float32Array.from(ends), 3));
  return new LineSegments(geometry, new LineBasicMaterial({ color: 0x3c4854 }));
}

/** The facets by the place that they cover when they are seen from above. */
class Plan {
  private readonly across: Vector3;
  private readonly along: Vector3;
  /** Three numbers a corner: across, along and upwards. */
  private readonly places: Float32Array;
  private readonly low: [number, number] = [Infinity, Infinity];
  private readonly cell: number;
  private readonly columns: number;
  private readonly rows: number;
  /** The facets of cell n are those from `starts[n]` to `starts[n + 1]` of `facets`. */
  private readonly starts: Uint32Array;
  private readonly facets: Uint32Array;

  constructor(
    private readonly corners: Float32Array,
    private readonly up: Vector3,
  ) {
    this.across = new Vector3(1, 0, 0);
    if (Math.abs(up.x) > 0.9) this.across.set(0, 1, 0);
    this.along = new Vector3().crossVectors(up, this.across).normalize();
    this.across.crossVectors(this.along, up);
    const places = new Float32Array(corners.length);
    const high = [-Infinity, -Infinity];
    for (let from = 0; from < corners.length; from += 3) {
      A.fromArray(corners, from);
      const place = [A.dot(this.across), A.dot(this.along), A.dot(up)] as const;
      places.set(place, from);
      for (const axis of [0, 1] as const) {
        this.low[axis] = Math.min(this.low[axis], place[axis]);
        high[axis] = Math.max(high[axis]!, place[axis]);
      }
    }
    this.places = places;
    const sides = [high[0]! - this.low[0], high[1]! - this.low[1]] as const;
    const cells = Math.min(Math.max(Math.ceil(Math.sqrt(corners.length / 9)), 1), MOST_CELLS);
    this.cell = Math.max(sides[0], sides[1], 1e-9) / cells;
    this.columns = Math.floor(sides[0] / this.cell) + 1;
    this.rows = Math.floor(sides[1] / this.cell) + 1;
    const counts = new Uint32Array(this.columns * this.rows + 1);
    this.covered((cell) => counts[cell + 1]!++);
    for (let cell = 1; cell < counts.length; cell++) counts[cell]! += counts[cell - 1]!;
    this.starts = counts;
    this.facets = new Uint32Array(counts.at(-1)!);
    const next = counts.slice();
    this.covered((cell, facet) => (this.facets[next[cell]!++] = facet));
  }

  above(place: Vector3): Vector3 | null {
    const [x, y] = [place.dot(this.across), place.dot(this.along)];
    const met = this.highest(x, y);
    return met && this.at(x, y, met.height);
  }

  normal(place: Vector3): Vector3 {
    const met = this.highest(place.dot(this.across), place.dot(this.along));
    if (!met) return this.up.clone();
    facetOf(this.corners, met.facet);
    const normal = B.sub(A).cross(C.sub(A)).normalize().clone();
    return normal.dot(this.up) < 0 ? normal.negate() : normal;
  }

  middle(): Vector3 {
    let [x, y, sum] = [0, 0, 0];
    for (let from = 0; from < this.places.length; from += 9) {
      const [ax, ay, , bx, by, , cx, cy] = this.places.subarray(from, from + 9) as unknown as number[];
      const area = Math.abs((bx! - ax!) * (cy! - ay!) - (cx! - ax!) * (by! - ay!));
      x += (area * (ax! + bx! + cx!)) / 3;
      y += (area * (ay! + by! + cy!)) / 3;
      sum += area;
    }
    return this.at(x / Math.max(sum, 1e-30), y / Math.max(sum, 1e-30), 0);
  }

  /** The corner nearest to a place when it is seen from above. */
  nearest(place: Vector3): Vector3 {
    const [x, y] = [place.dot(this.across), place.dot(this.along)];
    let [best, least] = [0, Infinity];
    for (let from = 0; from < this.places.length; from += 3) {
      const distance = Math.hypot(this.places[from]! - x, this.places[from + 1]! - y);
      if (distance < least) [best, least] = [from, distance];
    }
    return new Vector3().fromArray(this.corners, best);
  }

  private at(x: number, y: number, height: number): Vector3 {
    const place = new Vector3().addScaledVector(this.across, x).addScaledVector(this.along, y);
    return place.addScaledVector(this.up, height);
  }

  /** The uppermost facet over a place in plan, and how high it is there. */
  private highest(x: number, y: number): { height: number; facet: number } | null {
    const [column, row] = [this.index(x, 0), this.index(y, 1)];
    if (column < 0 || row < 0 || column >= this.columns || row >= this.rows) return null;
    const cell = row * this.columns + column;
    let found: { height: number; facet: number } | null = null;
    for (let index = this.starts[cell]!; index < this.starts[cell + 1]!; index++) {
      const facet = this.facets[index]!;
      const height = this.height(facet, x, y);
      if (height > (found?.height ?? -Infinity)) found = { height, facet };
    }
    return found;
  }

  /** Height of a facet at a place in plan; NaN beside it. */
  private height(facet: number, x: number, y: number): number {
    const { places } = this;
    const from = 9 * facet;
    const [ax, ay] = [places[from]!, places[from + 1]!];
    const [bx, by, cx, cy] = [places[from + 3]! - ax, places[from + 4]! - ay, places[from + 6]! - ax, places[from + 7]! - ay];
    const area = bx * cy - cx * by;
    const [px, py] = [x - ax, y - ay];
    const [second, third] = [(px * cy - cx * py) / area, (bx * py - px * by) / area];
    if (!(second >= -EDGE && third >= -EDGE && second + third <= 1 + EDGE)) return Number.NaN;
    const [za, zb, zc] = [places[from + 2]!, places[from + 5]!, places[from + 8]!];
    return za + second * (zb - za) + third * (zc - za);
  }

  private index(value: number, axis: 0 | 1): number {
    return Math.floor((value - this.low[axis]) / this.cell);
  }

  /** Calls for every cell of every facet's bounds. */
  private covered(act: (cell: number, facet: number) => void): void {
    const { places } = this;
    for (let facet = 0; facet < places.length / 9; facet++) {
      const bounds = ([0, 1] as const).map((axis) => {
        const values = [0, 3, 6].map((corner) => places[9 * facet + corner + axis]!);
        return [this.index(Math.min(...values), axis), this.index(Math.max(...values), axis)] as const;
      });
      for (let row = bounds[1]![0]; row <= bounds[1]![1]; row++) {
        for (let column = bounds[0]![0]; column <= bounds[0]![1]; column++) act(row * this.columns + column, facet);
      }
    }
  }
}

// Places on a facet's side belong to it, whatever rounding does.
const EDGE = 1e-6;
