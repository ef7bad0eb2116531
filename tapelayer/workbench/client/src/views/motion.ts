import type { Blocks, Made, Table } from "../data/types";

export interface Axis {
  name: string;
  unit: string;
  revolute: boolean;
}

/** The events that switch each device on and off. */
const SWITCHES: Record<string, [on: string, off: string]> = {
  shoe: ["shoe_down", "shoe_up"],
  roller: ["roller_down", "roller_up"],
  knife_1: ["knife_1_down", "knife_1_up"],
  knife_2: ["knife_2_down", "knife_2_up"],
  heater: ["heater_on", "heater_off"],
  air: ["air_on", "air_off"],
  arc: ["arc_on", "arc_off"],
};

/** Index of the first value not below `value` from `low` up to `high`, between which they are ascending. */
export function lowerBound(ascending: ArrayLike<number>, value: number, high = ascending.length, low = 0): number {
  while (low < high) {
    const middle = (low + high) >>> 1;
    if (ascending[middle]! < value) low = middle + 1;
    else high = middle;
  }
  return low;
}

/**
 * A program as motion: the value of every axis in every row of the poses.
 *
 * A position in it is a row and a time: the row is the one that the machine moves towards or stands at.
 */
export class Motion {
  readonly axes: readonly Axis[];
  readonly times: Float32Array;
  readonly lines: Int32Array;
  readonly courses: Int32Array;
  readonly rows: number;
  readonly duration: number;
  /** Switches that the program uses. */
  readonly switches: readonly string[];
  private readonly stated: Float32Array;
  private readonly held: Float32Array;
  private readonly states: Uint8Array;
  private readonly blockOf: Int32Array;

  constructor(
    poses: Table,
    readonly blocks: Blocks,
  ) {
    const columns = poses.columns.filter((column) => column !== "time_s");
    this.axes = columns.map((column) => {
      const [name, unit] = [column.slice(0, column.lastIndexOf("_")), column.slice(column.lastIndexOf("_") + 1)];
      return { name, unit, revolute: unit === "deg" };
    });
    this.rows = poses.rows;
    this.times = poses.column("time_s");
    this.duration = this.rows ? this.times[this.rows - 1]! : 0;
    this.lines = Int32Array.from(blocks.lines);
    this.courses = Int32Array.from(blocks.courses);
    const width = columns.length;
    this.stated = new Float32Array(this.rows * width);
    this.held = new Float32Array(this.rows * width);
    columns.forEach((column, index) => this.fill(poses.column(column), index, width));
    this.blockOf = Int32Array.from(blocks.blocks);
    const events = Object.entries(SWITCHES).filter(([, words]) => this.has(words[0]) || this.has(words[1]));
    this.switches = events.map(([name]) => name);
    this.states = this.switched(events.map(([, words]) => words));
  }

  /** Row that the machine moves towards, or stands at, at a time. */
  rowAt(time_s: number): number {
    return Math.min(lowerBound(this.times, time_s), Math.max(this.rows - 1, 0));
  }

  /** Fraction of the motion to the row that is done at a time, 0 to 1. */
  done(row: number, time_s: number): number {
    if (row === 0) return 1;
    const begin = this.times[row - 1]!;
    const end = this.times[row]!;
    return end > begin ? Math.min(Math.max((time_s - begin) / (end - begin), 0), 1) : 1;
  }

  /** Value of an axis in mm or deg for drawing; before an axis is stated, it has its first stated value. */
  drawn(axis: number, row: number, done: number): number {
    return this.between(this.held, axis, row, done);
  }

  /** Value of an axis in mm or deg as the program states it, NaN before it does. */
  value(axis: number, row: number, done: number): number {
    return this.between(this.stated, axis, row, done);
  }

  /** Whether something is switched on in a row. */
  isOn(name: string, row: number): boolean {
    const bit = this.switches.indexOf(name);
    return bit >= 0 && row < this.rows && ((this.states[row]! >> bit) & 1) === 1;
  }

  /** Number of a row's block; 0 is the start. */
  block(row: number): number {
    return this.blockOf[row] ?? 0;
  }

  /** Row at the end of the block that is `blocks` later, or earlier if negative, within the program. */
  stepped(row: number, done: number, blocks: number): number {
    const inside = done < 1 || (row + 1 < this.rows && this.blockOf[row + 1] === this.blockOf[row]);
    const last = this.blockOf[this.rows - 1] ?? 0;
    // Inside a block, a step forward goes to its end; a step back, to its start.
    const target = this.blockOf[row]! + blocks - (inside && blocks > 0 ? 1 : 0);
    return lowerBound(this.blockOf, Math.min(Math.max(target, 0), last) + 1) - 1;
  }

  /** Last row of a line, or of the nearest line before it that has rows. */
  rowOfLine(line: number): number {
    return Math.max(lowerBound(this.lines, line + 1) - 1, 0);
  }

  /** Row at the end of the first block of a course; -1 if it has none. */
  rowOfCourse(course: number): number {
    const first = this.courses.indexOf(course);
    return first < 0 ? first : lowerBound(this.blockOf, this.blockOf[first]! + 1) - 1;
  }

  private between(values: Float32Array, axis: number, row: number, done: number): number {
    const width = this.axes.length;
    const end = values[row * width + axis]!;
    if (done >= 1 || row === 0) return end;
    const begin = values[(row - 1) * width + axis]!;
    return begin + (end - begin) * done;
  }

  private fill(column: Float32Array, index: number, width: number): void {
    const first = column.findIndex((value) => !Number.isNaN(value));
    for (let row = 0; row < this.rows; row++) {
      const value = column[row]!;
      this.stated[row * width + index] = value;
      this.held[row * width + index] = first < 0 ? 0 : column[Math.max(row, first)]!;
    }
  }

  private has(event: string): boolean {
    const number = this.blocks.event_names.indexOf(event);
    return number >= 0 && this.blocks.events.includes(number);
  }

  private switched(words: readonly [on: string, off: string][]): Uint8Array {
    const { events, event_names } = this.blocks;
    const on = words.map(([word]) => event_names.indexOf(word));
    const off = words.map(([, word]) => event_names.indexOf(word));
    const states = new Uint8Array(this.rows);
    let state = 0;
    for (let row = 0; row < this.rows; row++) {
      const turnedOn = on.indexOf(events[row]!);
      const turnedOff = off.indexOf(events[row]!);
      if (turnedOn >= 0) state |= 1 << turnedOn;
      if (turnedOff >= 0) state &= ~(1 << turnedOff);
      states[row] = state;
    }
    return states;
  }
}

const motions = new WeakMap<Made, Motion>();

/** The motion of a job's results, cached. */
export function motionOf(made: Made): Motion {
  const motion = motions.get(made) ?? new Motion(made.poses, made.blocks);
  motions.set(made, motion);
  return motion;
}
