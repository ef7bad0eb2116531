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
    return between(this.places, along, this.rows.get(course), this.valueOf(column));
  }

  /** Value of a column at a time. */
  when(column: string, time_s: number): number {
    return between(this.times, time_s, { first: 0, end: this.times.length }, this.valueOf(column));
  }

  /** Arc length in mm on a course at a time. */
  along(course: number, time_s: number): number {
    return between(this.times, time_s, this.rows.get(course), (row) => this.places[row]!);
  }

  private valueOf(column: string): (row: number) => number {
    const index = this.errors.index(column);
    return (row) => this.errors.data[row * this.errors.columns.length + index]!;
  }
}

/** Value at a place between rows of ascending places; NaN without rows, that of the nearest beyond their ends. */
function between(places: Float32Array, place: number, rows: Stretch | undefined, value: (row: number) => number): number {
  if (!rows || rows.end <= rows.first) return Number.NaN;
  const next = Math.min(lowerBound(places, place, rows.end, rows.first), rows.end - 1);
  const before = Math.max(next - 1, rows.first);
  const span = places[next]! - places[before]!;
  const share = span > 0 ? Math.min(Math.max((place - places[before]!) / span, 0), 1) : 1;
  return value(before) + (value(next) - value(before)) * share;
}

/** First row and row after the last. */
interface Stretch {
  first: number;
  end: number;
}

/** The rows of every number. */
type Stretches = Map<number, Stretch>;

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
