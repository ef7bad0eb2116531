import { Box3, BufferAttribute, BufferGeometry, DoubleSide, Group, Mesh, MeshLambertMaterial, Vector3 } from "three";
import type { Raycaster } from "three";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";
import type { Planned, Table } from "../data/types";
import { h } from "../elements";
import { t } from "../i18n";
import { BARE, BEYOND, ERRORS, inDigits, legend, linear, placeOf, scaleOf, UNDER } from "./legend";
import type { Mould } from "./mould";
import { Strokes } from "./strokes";
import { MM, numberOf } from "./work";

/** What the colours of planned courses tell. */
export const MAPS = ["course", "gap", "strain", "lift", "angle", "residual"] as const;
export type Map2D = (typeof MAPS)[number];

/** The column of the tape that a map shows, and the limit of its values. */
const COLUMNS: Partial<Record<Map2D, [column: string, limit: string]>> = {
  strain: ["strain_percent", "max_strain_percent"],
  lift: ["lift_mm", "max_lift_mm"],
  angle: ["angle_deg", "max_angle_deviation_deg"],
  residual: ["residual_mm", "max_surface_residual_mm"],
};

// Tape is drawn this far above the mould, metres.
const LIFT = 0.4e-3;
// Arrows stand at these shares of a course, as large as this share of its width.
const ARROWS = [0.2, 0.8];
const ARROW = 0.3;
// Widths of the lines of gaps, pixels.
const GAP = 6;
const TAPE = [linear([52, 88, 126]), linear([92, 132, 172])];
const PALE = linear([205, 214, 222]);
const SHADES = linear(ERRORS);
const [RED, GREY, BLUE] = [linear(BEYOND), linear(BARE), linear(UNDER)];

/** Rows of one course. */
interface Stretch {
  number: number;
  first: number;
  end: number;
}

/** Planned courses over their mould, coloured by what was found along them. Metres, in the mould's axes. */
export class Courses {
  readonly object = new Group();
  readonly box = new Box3();
  /** The number of every course, and where it stands. */
  readonly numbers: readonly [HTMLElement, Vector3][];
  readonly maps: readonly Map2D[];
  private readonly courses: Stretch[];
  private readonly colours: BufferAttribute;
  private readonly tape: Mesh<BufferGeometry, MeshLambertMaterial>;
  private readonly chosen: Mesh<BufferGeometry, MeshLambertMaterial>;
  private readonly arrows = new Strokes(0x18222c, 2);
  private readonly outline = new Strokes(0x18222c, 2);
  private readonly seams = new LineSegments2(new LineSegmentsGeometry(), new LineMaterial({ linewidth: GAP, vertexColors: true }));

  private constructor(
    private readonly planned: Planned,
    private readonly table: Table,
    private readonly gaps: Table | null,
    boundary: Table | null,
    mould: Mould,
    private readonly chose: (course: number) => void,
  ) {
    this.courses = stretchesOf(table.column("course"));
    this.maps = MAPS.filter((map) => {
      const column = COLUMNS[map]?.[0];
      return map === "gap" ? gaps?.rows : !column || table.column(column).some(Number.isFinite);
    });
    const corners = edgesOf(table);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(corners, 3));
    geometry.setIndex(quadsOf(this.courses));
    geometry.computeVertexNormals();
    this.colours = new BufferAttribute(new Uint8Array(corners.length), 3, true);
    geometry.setAttribute("color", this.colours);
    this.tape = new Mesh(geometry, new MeshLambertMaterial({ vertexColors: true, side: DoubleSide }));
    const marked = { color: 0xf08c00, transparent: true, opacity: 0.75, depthWrite: false, side: DoubleSide };
    const above = { polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -8 };
    this.chosen = new Mesh(geometry.clone(), new MeshLambertMaterial({ ...marked, ...above }));
    Object.assign(this.seams.material, { polygonOffset: true, polygonOffsetFactor: -4, polygonOffsetUnits: -64 });
    this.object.add(this.tape, this.chosen, this.seams, this.arrows.object, this.outline.object);
    for (const child of this.object.children) child.frustumCulled = false;
    this.box.setFromBufferAttribute(geometry.getAttribute("position") as BufferAttribute);
    this.arrows.show(this.courses.flatMap((course) => this.arrowsOf(course)));
    if (boundary) this.outline.show(ringsOf(boundary).map((ring) => mould.trace(ring)));
    this.numbers = this.courses.map((course) => [this.numberOf(course), this.middle(Math.floor((course.first + course.end - 1) / 2))]);
    this.select(0);
    this.colour("course");
  }

  /** @param chose takes the number of a course that was chosen. */
  static async of(planned: Planned, mould: Mould, chose: (course: number) => void): Promise<Courses | null> {
    const [tape, gaps, boundary] = await Promise.all((["tape", "gaps", "boundary"] as const).map((name) => planned.table(name)));
    return tape?.rows ? new Courses(planned, tape, gaps ?? null, boundary ?? null, mould, chose) : null;
  }

  /** Highlights a course; 0 for none. */
  select(number: number): void {
    const found = this.courses.find((course) => course.number === number);
    this.chosen.visible = found !== undefined;
    for (const [label] of this.numbers ?? []) label.classList.toggle("chosen", label.textContent === String(number));
    if (!found) return;
    // One quad less than pairs in every course before this one.
    const before = found.first - this.courses.indexOf(found);
    this.chosen.geometry.setDrawRange(6 * before, 6 * (found.end - found.first - 1));
  }

  /** What is under a ray: the course, and its value on the map that is shown. */
  hit(raycaster: Raycaster): { course: number; words: string } | null {
    const [met] = raycaster.intersectObject(this.tape, false);
    if (!met?.face) return null;
    const row = Math.floor(met.face.a / 2);
    const course = this.table.at(row, "course");
    const lines = [t("plan.course", { course })];
    const along = this.table.at(row, "arc_length_mm");
    if (Number.isFinite(along)) lines.push(t("plan.along", { along: along.toFixed(0) }));
    for (const [map, entry] of Object.entries(COLUMNS)) {
      const value = this.table.at(row, entry![0]);
      if (Number.isFinite(value)) lines.push(t("plan.value", { name: t(`plan.map.${map}`), value: inDigits(Math.abs(value)), unit: unitOf(entry![0]) }));
    }
    return { course, words: lines.join("\n") };
  }

  /** Colours them by a map; returns its scale if there is one. */
  colour(by: Map2D): HTMLElement | null {
    this.seams.visible = by === "gap";
    const column = COLUMNS[by];
    if (column) return this.colourBy(by, ...column);
    this.courses.forEach(({ first, end }, index) => {
      const colour = by === "gap" ? PALE : TAPE[index % 2]!;
      for (let row = first; row < end; row++) this.paint(row, colour, 0);
    });
    this.colours.needsUpdate = true;
    return by === "gap" ? this.colourGaps() : null;
  }

  dispose(): void {
    for (const mesh of [this.tape, this.chosen]) {
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
    this.seams.geometry.dispose();
    this.seams.material.dispose();
    this.arrows.dispose();
    this.outline.dispose();
    for (const [label] of this.numbers) label.remove();
  }

  private colourBy(by: Map2D, column: string, key: string): HTMLElement {
    const values = this.table.column(column).map(Math.abs);
    const limit = numberOf(this.planned.setup, "limits", key, Infinity);
    const greatest = values.reduce((most, value) => (value > most ? value : most), 0);
    // Plans are comparable only where the scale ends at the limit.
    const most = Number.isFinite(limit) ? limit : greatest;
    values.forEach((value, row) => {
      if (Number.isNaN(value)) this.paint(row, GREY, 0);
      else if (value > most) this.paint(row, RED, 0);
      else this.paint(row, SHADES, placeOf(value, most));
    });
    this.colours.needsUpdate = true;
    const title = `${t(`plan.map.${by}`)}, ${unitOf(column)}`;
    const ticks = [0, most / 2, most].map(inDigits);
    const notes: Record<string, string> = { limit: t("plan.limit", { limit: most, found: inDigits(greatest) }) };
    if (greatest > most) notes["beyond"] = t("scene.beyond");
    return legend(scaleOf(ERRORS, { title, ticks, notes }));
  }

  /** Colours the seams between courses by their gap: blue for an allowed overlap, red beyond the limits. */
  private colourGaps(): HTMLElement {
    const { setup } = this.planned;
    const largest = numberOf(setup, "limits", "max_gap_mm", numberOf(setup, "gap", "largest_mm", 0));
    const overlap = numberOf(setup, "limits", "max_overlap_mm", -numberOf(setup, "gap", "least_mm", 0));
    const table = this.gaps!;
    const values = table.column("gap_mm");
    const [ends, colours] = [[] as number[], [] as number[]];
    const put = (row: number): void => {
      const gap = values[row]!;
      const [from, at] = gap > largest || gap < -overlap ? [RED, 0] : gap < 0 ? [BLUE, 0] : [SHADES, placeOf(gap, largest)];
      for (const axis of ["x", "y", "z"]) ends.push(table.at(row, `${axis}_mm`) * MM);
      for (let part = 0; part < 3; part++) colours.push(from[at + part]! / 255);
    };
    for (let row = 1; row < table.rows; row++) {
      const together = ["right", "left"].every((side) => table.at(row, side) === table.at(row - 1, side));
      if (!together || !Number.isFinite(values[row]) || !Number.isFinite(values[row - 1])) continue;
      put(row - 1);
      put(row);
    }
    this.seams.geometry.dispose();
    this.seams.geometry = new LineSegmentsGeometry();
    if (ends.length) this.seams.geometry.setPositions(ends).setColors(colours);
    this.seams.visible = ends.length > 0;
    const found = values.filter(Number.isFinite);
    const [least, most] = [found.reduce((low, gap) => Math.min(low, gap), Infinity), found.reduce((high, gap) => Math.max(high, gap), -Infinity)];
    const notes: Record<string, string> = { limit: t("plan.limit.gap", { largest, overlap, least: least.toFixed(2), most: most.toFixed(2) }) };
    if (least < 0 && overlap > 0) notes["under"] = t("plan.overlap");
    if (most > largest || least < -overlap) notes["beyond"] = t("scene.beyond");
    return legend(scaleOf(ERRORS, { title: `${t("plan.map.gap")}, mm`, ticks: [0, largest / 2, largest].map(inDigits), notes }));
  }

  private paint(row: number, colours: ArrayLike<number>, from: number): void {
    for (let end = 0; end < 2; end++) {
      for (let part = 0; part < 3; part++) this.colours.array[6 * row + 3 * end + part] = colours[from + part]!;
    }
  }

  private numberOf({ number }: Stretch): HTMLElement {
    const about = t("plan.course", { course: number });
    return h("button", { type: "button", class: "scene-number", testid: "course-number", title: about, "aria-label": about, onclick: () => this.chose(number) }, String(number));
  }

  private corner(row: number, end: 0 | 1): Vector3 {
    return new Vector3().fromBufferAttribute(this.tape.geometry.getAttribute("position") as BufferAttribute, 2 * row + end);
  }

  private middle(row: number): Vector3 {
    return this.corner(row, 0).add(this.corner(row, 1)).multiplyScalar(0.5);
  }

  /** Arrows in a course's direction, on the tape. */
  private arrowsOf({ first, end }: Stretch): Vector3[][] {
    return ARROWS.map((share) => {
      const row = Math.round(first + share * (end - 1 - first));
      const [tip, size] = [this.middle(row), ARROW * this.corner(row, 0).distanceTo(this.corner(row, 1))];
      let back = row;
      while (back > first && this.middle(back).distanceTo(tip) < size) back -= 1;
      const side = (part: number): Vector3 => this.corner(back, 0).lerp(this.corner(back, 1), part);
      return [side(0.5 - ARROW), tip, side(0.5 + ARROW)];
    });
  }
}

const unitOf = (column: string): string => ({ percent: "%", mm: "mm", deg: "°" })[column.split("_").at(-1)!] ?? "";

function stretchesOf(numbers: Float32Array): Stretch[] {
  const found: Stretch[] = [];
  numbers.forEach((number, row) => {
    if (found.at(-1)?.number === number) found.at(-1)!.end = row + 1;
    else found.push({ number, first: row, end: row + 1 });
  });
  return found;
}

/** Two points a row, left and right, lifted off the mould. */
function edgesOf(table: Table): Float32Array {
  const columns = ["left", "right"].flatMap((side) => ["x", "y", "z"].map((axis) => table.index(`${side}_${axis}_mm`)));
  const corners = new Float32Array(6 * table.rows);
  for (let row = 0; row < table.rows; row++) {
    columns.forEach((column, part) => (corners[6 * row + part] = table.data[row * table.columns.length + column]! * MM));
  }
  const courses = table.column("course");
  const lifted = corners.slice();
  const [left, right, other, along] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];
  for (let row = 0; row < table.rows; row++) {
    const next = courses[row + 1] === courses[row] ? row + 1 : row - 1;
    if (next < 0) continue;
    left.fromArray(corners, 6 * row);
    right.fromArray(corners, 6 * row + 3);
    // Pairs of a cut share one end.
    along.fromArray(corners, 6 * next).sub(left).add(other.fromArray(corners, 6 * next + 3).sub(right));
    if (next < row) along.negate();
    const normal = along.cross(left.clone().sub(right)).normalize();
    for (let part = 0; part < 6; part++) lifted[6 * row + part]! += LIFT * normal.getComponent(part % 3);
  }
  return lifted;
}

function quadsOf(courses: Stretch[]): number[] {
  return courses.flatMap(({ first, end }) => {
    const pairs = Array.from({ length: end - first - 1 }, (_, index) => 2 * (first + index));
    return pairs.flatMap((left) => [left, left + 1, left + 2, left + 1, left + 3, left + 2]);
  });
}

function ringsOf(table: Table): Vector3[][] {
  const rings: Vector3[][] = [];
  for (let row = 0; row < table.rows; row++) {
    const place = new Vector3(...(["x_mm", "y_mm", "z_mm"].map((name) => table.at(row, name) * MM) as [number, number, number]));
    if (row && table.at(row, "ring") === table.at(row - 1, "ring")) rings.at(-1)!.push(place);
    else rings.push([place]);
  }
  return rings;
}
