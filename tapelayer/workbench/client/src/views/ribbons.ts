import {
  Box3,
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  DynamicDrawUsage,
  Group,
  LessDepth,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshLambertMaterial,
  Ray,
  Triangle,
  Vector3,
} from "three";
import { BEYOND, ERRORS, linear, placeOf } from "./legend";
import { lowerBound } from "./motion";
import type { Table } from "../data/types";

const MM = 1e-3;
// Tape is drawn this far above the surface, metres: more than a coarsened mould deviates in most places.
const LIFT = 0.4e-3;
// During motion, at most this many pairs are drawn, besides those at the ends of courses, where the cuts are.
const MOVING_PAIRS = 12_000;
const CUT = 4;
// A pair at least this share of the widest is not part of a cut.
const FULL = 0.999;
// Neighbouring courses differ slightly in colour, so that their borders are visible.
const TAPE = [linear([52, 88, 126]), linear([92, 132, 172])];
const SHADES = linear(ERRORS);
const RED = linear(BEYOND);

/** Quads of the tape between a selection of its pairs, the last first: seen from above, the top ply hides the rest. */
interface Weave {
  indices: Uint32Array;
  /** Number of quads. */
  count: number;
  /** Quads up to every pair. */
  quads: Int32Array;
  /** Pair at which the last of these quads ends. */
  ends: Int32Array;
}

interface Course {
  number: number;
  first: number;
  end: number;
  box: Box3;
}

/** A place on the tape that a ray hit: metres, seconds, and mm along and to the left of the course. */
export interface Struck {
  course: number;
  place: Vector3;
  distance: number;
  time: number;
  along: number;
  across: number;
}

/** The tape of all courses as it is laid. Metres, in the machine's axes. */
export class Ribbons {
  readonly object = new Group();
  readonly box = new Box3();
  readonly courses: readonly Course[];
  private readonly times: Float32Array;
  private readonly places: Float32Array;
  private readonly lefts: Float32Array;
  private readonly fine: Weave;
  private readonly coarse: Weave;
  private readonly corners: Float32Array;
  private readonly laid: Mesh<BufferGeometry>;
  private readonly rough: Mesh<BufferGeometry>;
  private readonly chosen: Mesh<BufferGeometry>;
  private readonly tip: Mesh<BufferGeometry>;
  private readonly ahead: LineSegments<BufferGeometry>;
  private readonly paths: Int32Array;
  private readonly tapeColours: Uint8Array;
  private readonly materials = {
    // Of plies at one depth the first that is drawn stays, which is the last laid.
    tape: new MeshLambertMaterial({ vertexColors: true, side: DoubleSide, depthFunc: LessDepth }),
    chosen: new MeshLambertMaterial({
      ...{ color: 0xf08c00, side: DoubleSide, transparent: true, opacity: 0.8, depthWrite: false },
      ...{ polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -8 },
    }),
    path: new LineBasicMaterial({ color: 0x7d8995, transparent: true, opacity: 0.55 }),
  };
  private pair = -1;

  constructor(private readonly table: Table) {
    const pairs = table.rows;
    this.times = table.column("time_s");
    this.places = table.column("arc_length_mm");
    this.lefts = table.column("left_mm");
    this.courses = coursesOf(table.column("course"));
    this.corners = cornersOf(table);
    const normals = normalsOf(this.corners, this.courses);
    for (let value = 0; value < this.corners.length; value++) this.corners[value]! += LIFT * normals[value]!;
    this.paths = new Int32Array(pairs);
    this.fine = woven(this.courses, pairs, 1);
    this.coarse = woven(this.courses, pairs, Math.ceil(pairs / MOVING_PAIRS));
    this.tapeColours = new Uint8Array(6 * pairs);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(this.corners, 3));
    geometry.setAttribute("normal", new BufferAttribute(normals, 3));
    geometry.setAttribute("color", new BufferAttribute(this.tapeColours, 3, true));
    geometry.setIndex(new BufferAttribute(this.fine.indices, 1));
    const rough = shared(geometry).setIndex(new BufferAttribute(this.coarse.indices, 1));
    this.laid = new Mesh(geometry, this.materials.tape);
    this.rough = new Mesh(rough, this.materials.tape);
    this.chosen = new Mesh(shared(geometry), this.materials.chosen);
    this.tip = new Mesh(tipGeometry(), this.materials.tape);
    const middles = new BufferAttribute(middlesOf(this.corners), 3);
    const paths = new BufferGeometry().setAttribute("position", middles).setIndex(this.segments());
    for (const course of this.courses) {
      for (let corner = 2 * course.first; corner < 2 * course.end; corner++) {
        course.box.expandByPoint(POINT.fromArray(this.corners, 3 * corner));
      }
      this.box.union(course.box);
    }
    this.ahead = new LineSegments(paths, this.materials.path);
    this.object.add(this.ahead, this.laid, this.rough, this.chosen, this.tip);
    for (const child of this.object.children) child.frustumCulled = false;
    this.colourByCourse();
    this.select(0);
  }

  /** Shows the tape laid by a time, coarser during motion, and the centre lines ahead. */
  show(time_s: number, moving: boolean): void {
    // Pairs of equal time are laid together.
    let pair = lowerBound(this.times, time_s) - 1;
    while (pair + 1 < this.times.length && this.times[pair + 1]! <= time_s) pair += 1;
    this.laid.visible = !moving;
    this.rough.visible = moving;
    if (pair !== this.pair) {
      this.pair = pair;
      for (const [mesh, { quads, count }] of [[this.laid, this.fine], [this.rough, this.coarse]] as const) {
        const laid = pair < 0 ? 0 : quads[pair]!;
        mesh.geometry.setDrawRange(6 * (count - laid), 6 * laid);
      }
      this.ahead.geometry.setDrawRange(pair < 0 ? 0 : this.paths[pair]!, Infinity);
    }
    this.moveTip(time_s, moving ? this.coarse : this.fine);
  }

  /** Highlights a course, including the part not laid yet; 0 for none. */
  select(number: number): void {
    const course = this.courses.find((each) => each.number === number);
    this.chosen.visible = course !== undefined;
    if (!course) return;
    const [begin, end] = [this.fine.quads[course.first]!, this.fine.quads[course.end - 1]!];
    this.chosen.geometry.setDrawRange(6 * (this.fine.count - end), 6 * (end - begin));
  }

  colourByCourse(): void {
    this.courses.forEach(({ first, end }, index) => {
      const colour = TAPE[index % TAPE.length]!;
      for (let corner = 2 * first; corner < 2 * end; corner++) this.tapeColours.set(colour, 3 * corner);
    });
    this.coloured();
  }

  /**
   * Colours the tape by what was measured while it was laid, each pair by the worst up to halfway to its neighbours.
   *
   * @param times seconds, ascending. @param values at these times. @param most end of the ramp. @param limit of values.
   * @param worst of two values.
   */
  colourBy(
    times: Float32Array,
    values: Float32Array,
    most: number,
    limit: number,
    worst: (one: number, other: number) => number,
  ): void {
    const halfway = (pair: number, next: number): number => (this.times[pair]! + this.times[next]!) / 2;
    for (const { first, end } of this.courses) {
      for (let pair = first; pair < end; pair++) {
        const [from, to] = [halfway(Math.max(pair - 1, first), pair), halfway(pair, Math.min(pair + 1, end - 1))];
        let sample = Math.min(lowerBound(times, from), times.length - 1);
        let value = values[sample] ?? Number.NaN;
        while (++sample < times.length && times[sample]! <= to) value = worst(value, values[sample]!);
        // What was not measured counts as beyond the limit.
        const [colours, place] = value <= limit ? [SHADES, placeOf(value, most)] : [RED, 0];
        for (let part = 0; part < 6; part++) this.tapeColours[6 * pair + part] = colours[place + (part % 3)]!;
      }
    }
    this.coloured();
  }

  /** The first place hit by a ray in the machine's axes of the tape laid by a time; of plies in one place the last. */
  hit(ray: Ray, time_s: number): Struck | null {
    let found: Struck | null = null;
    for (const course of this.courses) {
      if (this.times[course.first]! > time_s) break;
      if (!ray.intersectBox(course.box, POINT)) continue;
      for (let corner = 2 * course.first; corner + 2 < 2 * course.end; corner++) {
        const struck = this.struck(ray, corner, course.number);
        if (struck && struck.time <= time_s && struck.distance <= (found?.distance ?? Infinity)) found = struck;
      }
    }
    return found;
  }

  dispose(): void {
    for (const child of this.object.children) {
      if (child instanceof Mesh || child instanceof LineSegments) child.geometry.dispose();
    }
    for (const material of Object.values(this.materials)) material.dispose();
  }

  /** Where a ray hits the triangle of a corner and the next two. */
  private struck(ray: Ray, corner: number, course: number): Struck | null {
    A.fromArray(this.corners, 3 * corner);
    B.fromArray(this.corners, 3 * (corner + 1));
    C.fromArray(this.corners, 3 * (corner + 2));
    if (!ray.intersectTriangle(A, B, C, false, POINT) || !Triangle.getBarycoord(POINT, A, B, C, SHARES)) return null;
    const between = (value: (corner: number) => number): number =>
      SHARES.x * value(corner) + SHARES.y * value(corner + 1) + SHARES.z * value(corner + 2);
    return {
      course,
      place: POINT.clone(),
      distance: ray.origin.distanceTo(POINT),
      time: between((each) => this.times[each >> 1]!),
      along: between((each) => this.places[each >> 1]!),
      across: between((each) => this.lefts[each >> 1]! - (each & 1 ? this.width(each >> 1) / MM : 0)),
    };
  }

  /** Draws the piece between the last drawn quad and the nip. */
  private moveTip(time_s: number, { ends }: Weave): void {
    const [last, next] = [this.pair, this.pair + 1];
    const { data, columns } = this.table;
    const column = this.table.index("course");
    const inside = last >= 0 && next < this.times.length;
    this.tip.visible = inside && data[last * columns.length + column] === data[next * columns.length + column];
    if (!this.tip.visible) return;
    const from = 6 * ends[last]!;
    const share = (time_s - this.times[last]!) / (this.times[next]! - this.times[last]!);
    const { position, normal, color } = this.tip.geometry.attributes as Record<string, BufferAttribute>;
    const normals = this.laid.geometry.getAttribute("normal").array;
    for (let value = 0; value < 6; value++) {
      const [begin, end] = [this.corners[6 * last + value]!, this.corners[6 * next + value]!];
      position!.array[value] = this.corners[from + value]!;
      position!.array[6 + value] = begin + (end - begin) * share;
      normal!.array[value] = normal!.array[6 + value] = normals[from + value]!;
      color!.array[value] = color!.array[6 + value] = this.tapeColours[from + value]!;
    }
    for (const attribute of [position!, normal!, color!]) attribute.needsUpdate = true;
  }

  /** Segments of the centre lines between pairs of full width; also counts the indices before every pair. */
  private segments(): BufferAttribute {
    const indices: number[] = [];
    for (const { first, end } of this.courses) {
      const widths = Array.from({ length: end - first }, (_, row) => this.width(first + row));
      const full = FULL * widths.reduce((most, width) => Math.max(most, width), 0);
      this.paths[first] = indices.length;
      for (let pair = first; pair + 1 < end; pair++) {
        // At a slanted cut, the midpoint of the edges is not on the centre line.
        if (Math.min(widths[pair - first]!, widths[pair + 1 - first]!) >= full) indices.push(pair, pair + 1);
        this.paths[pair + 1] = indices.length;
      }
    }
    return new BufferAttribute(Uint32Array.from(indices), 1);
  }

  private width(pair: number): number {
    return LEFT.fromArray(this.corners, 6 * pair).distanceTo(RIGHT.fromArray(this.corners, 6 * pair + 3));
  }

  private coloured(): void {
    this.laid.geometry.getAttribute("color").needsUpdate = true;
    this.pair = -2;
  }
}

const POINT = new Vector3();
const [A, B, C, SHARES] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];
const [LEFT, RIGHT] = [new Vector3(), new Vector3()];

function coursesOf(numbers: Float32Array): Course[] {
  const courses: Course[] = [];
  numbers.forEach((number, pair) => {
    const last = courses.at(-1);
    if (last?.number === number) last.end = pair + 1;
    else courses.push({ number, first: pair, end: pair + 1, box: new Box3() });
  });
  return courses;
}

/** Left and right edge points of every pair, (2 pairs, 3) metres. */
function cornersOf({ rows, columns, data, index }: Table): Float32Array {
  const corners = new Float32Array(6 * rows);
  const names = ["left_x_mm", "left_y_mm", "left_z_mm", "right_x_mm", "right_y_mm", "right_z_mm"];
  names.forEach((name, part) => {
    const column = index(name);
    for (let pair = 0; pair < rows; pair++) corners[6 * pair + part] = data[pair * columns.length + column]! * MM;
  });
  return corners;
}

function middlesOf(corners: Float32Array): Float32Array {
  const middles = new Float32Array(corners.length / 2);
  for (let value = 0; value < middles.length; value++) {
    const corner = 6 * Math.floor(value / 3) + (value % 3);
    middles[value] = (corners[corner]! + corners[corner + 3]!) / 2;
  }
  return middles;
}

/** Unit normals out of the surface at every edge point: the travel crossed with the left. */
function normalsOf(corners: Float32Array, courses: readonly Course[]): Float32Array {
  const normals = new Float32Array(corners.length);
  const middles = middlesOf(corners);
  const [along, left, normal, first] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];
  for (const course of courses) {
    let known = -1;
    for (let pair = course.first; pair < course.end; pair++) {
      const [before, after] = [Math.max(pair - 1, course.first), Math.min(pair + 1, course.end - 1)];
      along.fromArray(middles, 3 * after).sub(first.fromArray(middles, 3 * before));
      left.fromArray(corners, 6 * pair).sub(first.fromArray(corners, 6 * pair + 3));
      normal.crossVectors(along, left);
      // The tip of a slanted cut has no width and so no plane; it takes its neighbour's normal.
      if (left.length() > 1e-5 && normal.length() > 1e-9) normal.normalize();
      else if (known >= 0) normal.fromArray(normals, 6 * known);
      else continue;
      for (let back = known < 0 ? course.first : pair; back <= pair; back++) {
        normal.toArray(normals, 6 * back);
        normal.toArray(normals, 6 * back + 3);
      }
      known = pair;
    }
  }
  return normals;
}

/** Quads between every n-th pair of each course, and between all pairs near its ends, where the cuts are. */
function woven(courses: readonly Course[], pairs: number, stride: number): Weave {
  const quads = new Int32Array(pairs);
  const ends = new Int32Array(pairs);
  const indices = new Uint32Array(6 * pairs);
  let count = 0;
  for (const { first, end } of courses) {
    let last = first;
    for (let pair = first; pair < end; pair++) {
      const kept = (pair - first) % stride === 0 || pair < first + CUT || pair >= end - CUT;
      if (kept && pair > first) {
        const [left, next] = [2 * last, 2 * pair];
        indices.set([left, left + 1, next, left + 1, next + 1, next], 6 * count++);
      }
      if (kept) last = pair;
      quads[pair] = count;
      ends[pair] = last;
    }
  }
  return { indices: backwards(indices.subarray(0, 6 * count)), count, quads, ends };
}

/** Quads of six corners each, the last first. */
function backwards(indices: Uint32Array): Uint32Array {
  const turned = new Uint32Array(indices.length);
  for (let from = 0; from < indices.length; from += 6) {
    turned.set(indices.subarray(from, from + 6), indices.length - 6 - from);
  }
  return turned;
}

/** A geometry that shares the vertices but has its own draw range. */
function shared(geometry: BufferGeometry): BufferGeometry {
  const other = new BufferGeometry();
  for (const [name, values] of Object.entries(geometry.attributes)) other.setAttribute(name, values);
  return other.setIndex(geometry.index);
}

function tipGeometry(): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(12), 3).setUsage(DynamicDrawUsage));
  geometry.setAttribute("normal", new BufferAttribute(new Float32Array(12), 3).setUsage(DynamicDrawUsage));
  geometry.setAttribute("color", new BufferAttribute(new Uint8Array(12), 3, true).setUsage(DynamicDrawUsage));
  return geometry.setIndex([0, 1, 2, 1, 3, 2]);
}
