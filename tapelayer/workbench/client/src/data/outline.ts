/** A place in the mould's axes, in the mould's unit. */
export type Point = [x: number, y: number, z: number];

/** What a ply covers, as it is drawn: a closed line, and closed lines around its holes. */
export interface Outline {
  /** Null where the mould's edge is the boundary, or a file holds it. */
  boundary: Point[] | null;
  holes: Point[][];
}

/** Points as text, one a line. */
export const writePoints = (points: readonly Point[]): string => points.map((point) => point.join(", ")).join("\n");

/** Closed lines as text, an empty line between two. */
export const writeLoops = (loops: readonly Point[][]): string => loops.map(writePoints).join("\n\n");

/** Numbers a line of text; what is no number stays as it was written, so that the server says what is wrong with it. */
function readLine(line: string): unknown[] {
  return line
    .trim()
    .split(/[,;\s]+/)
    .map((word) => (Number.isFinite(Number(word)) ? Number(word) : word));
}

const uncommented = (text: string): string[] => text.split(/\r?\n/).map((line) => line.replace(/#.*$/, "").trim());

/** The points of a text, one a line. */
export const readPoints = (text: string): unknown[][] => uncommented(text).filter(Boolean).map(readLine);

/** The closed lines of a text, which empty lines divide. */
export function readLoops(text: string): unknown[][][] {
  const loops: unknown[][][] = [[]];
  for (const line of uncommented(text)) {
    if (line) loops.at(-1)!.push(readLine(line));
    else loops.push([]);
  }
  return loops.filter((loop) => loop.length > 0);
}

/** Whether a value is a list of points. */
export function arePoints(value: unknown): value is Point[] {
  if (!Array.isArray(value)) return false;
  return value.every((each) => Array.isArray(each) && each.length === 3 && each.every((part) => Number.isFinite(part)));
}

/** Whether a value is a list of closed lines. */
export const areLoops = (value: unknown): value is Point[][] => Array.isArray(value) && value.every(arePoints);
