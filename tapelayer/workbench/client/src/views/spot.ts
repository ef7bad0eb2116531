import type { Vector3 } from "three";
import { lowerBound } from "./motion";
import type { Table } from "../data/types";

/** A place on the work that is made and visible. */
export interface Spot {
  /** In the machine's axes, metres. */
  place: Vector3;
  /** From the origin of the ray that found it, metres. */
  distance: number;
  /** Number of its course or pass; 0 where none came near. */
  course: number;
  /** Nearest point of the course or pass, from 1. */
  point: number;
  /** Arc length on it, and distance to its left, mm. */
  along: number;
  across: number;
  /** When it was made, seconds. */
  time: number;
  /** What is measured there, and the ending of its text key; null for nothing. */
  measured: { what: string; value: number } | null;
}

/** What verification measured along the courses or passes, by arc length. */
export class Track {
  readonly times: Float32Array;
  private readonly places: Float32Array;
  private readonly rows: Stretches;
  private readonly points: Float32Array;
  private readonly pointRows: Stretches;

  /** @param what column of the numbers of courses or passes. */
  constructor(
    private readonly errors: Table,
    points: Table,
    what: string,
  ) {
    this.times = errors.column("time_s");
    this.rows = stretchesOf(errors.column(what));
    this.places = risen(errors.column("arc_length_mm"), this.rows);
    this.points = points.column("arc_length_mm");
    this.pointRows = stretchesOf(points.column(what));
  }

  /** Number of the point of a course nearest to an arc length in mm, from 1; 0 if it has none. */
  point(course: number, along: number): number {
    const rows = this.pointRows.get(course);
    if (!rows) return 0;
    const next = Math.min(lowerBound(this.points, along, rows.end, rows.first), rows.end - 1);
    const before = Math.max(next - 1, rows.first);
    const nearest = along - this.points[before]! <= this.points[next]! - along ? before : next;
    return nearest - rows.first + 1;
  }

  /** Value of a column at an arc length in mm of a course. */
  at(column: string, course: number, along: number): number {
    const rows = this.rows.get(course);
    if (!rows) return Number.NaN;
    const index = this.errors.index(column);
    const value = (row: number): number => this.errors.data[row * this.errors.columns.length + index]!;
    const next = Math.min(lowerBound(this.places, along, rows.end, rows.first), rows.end - 1);
    const before = Math.max(next - 1, rows.first);
    const span = this.places[next]! - this.places[before]!;
    const share = span > 0 ? Math.min(Math.max((along - this.places[before]!) / span, 0), 1) : 1;
    return value(before) + (value(next) - value(before)) * share;
  }

  /** Arc length in mm on a course at a time. */
  along(course: number, time_s: number): number {
    const rows = this.rows.get(course);
    if (!rows) return Number.NaN;
    const next = Math.min(lowerBound(this.times, time_s, rows.end, rows.first), rows.end - 1);
    const before = Math.max(next - 1, rows.first);
    const span = this.times[next]! - this.times[before]!;
    const share = span > 0 ? Math.min(Math.max((time_s - this.times[before]!) / span, 0), 1) : 1;
    return this.places[before]! + (this.places[next]! - this.places[before]!) * share;
  }
}

/** First row and row after the last of every number. */
type Stretches = Map<number, { first: number; end: number }>;

function stretchesOf(numbers: Float32Array): Stretches {
  const found: Stretches = new Map();
  numbers.forEach((number, row) => {
    const stretch = found.get(number);
    if (stretch) stretch.end = row + 1;
    else found.set(number, { first: row, end: row + 1 });
  });
  return found;
}

/** Arc lengths that nowhere fall in a course: places that were not measured have the one before. */
function risen(places: Float32Array, stretches: Stretches): Float32Array {
  const found = new Float32Array(places.length);
  for (const { first, end } of stretches.values()) {
    let most = -Infinity;
    for (let row = first; row < end; row++) {
      const place = places[row]!;
      if (place > most) most = place;
      found[row] = most;
    }
  }
  return found;
}
