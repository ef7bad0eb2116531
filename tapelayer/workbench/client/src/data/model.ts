/** A mesh as its STL file has it. */
export interface Model {
  name: string;
  /** Nine numbers a facet, in the file's unit. */
  corners: Float32Array;
  /** Along x, y and z, in the file's unit. */
  size: [number, number, number];
}

export const UNITS = { mm: 1, cm: 10, m: 1000, in: 25.4 } as const;
export type Unit = keyof typeof UNITS;

// Millimetres: a mould that is smaller or larger is taken for one in another unit.
const SMALLEST = 100;
const LARGEST = 40_000;

const HEADER = 80;
const RECORD = 50;
const VERTEX = /\bvertex\s+(\S+)\s+(\S+)\s+(\S+)/gi;

/** Reads an STL for the view; null where there is nothing to be seen in it. What is wrong with it, the server says. */
export async function readModel(file: File): Promise<Model | null> {
  const bytes = await file.arrayBuffer();
  const corners = binary(bytes) ?? text(bytes);
  if (!corners.length || corners.length % 9 || !corners.every(Number.isFinite)) return null;
  const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  corners.forEach((value, index) => {
    const axis = index % 3;
    if (value < low[axis]!) low[axis] = value;
    if (value > high[axis]!) high[axis] = value;
  });
  const side = (axis: number): number => high[axis]! - low[axis]!;
  return { name: file.name, corners, size: [side(0), side(1), side(2)] };
}

/** Corners of a binary STL; null where its length is not that of its facets. */
function binary(bytes: ArrayBuffer): Float32Array | null {
  if (bytes.byteLength < HEADER + 4) return null;
  const view = new DataView(bytes);
  const facets = view.getUint32(HEADER, true);
  if (!facets || bytes.byteLength < HEADER + 4 + RECORD * facets) return null;
  const corners = new Float32Array(9 * facets);
  for (let facet = 0; facet < facets; facet++) {
    // Behind the normal.
    const from = HEADER + 4 + RECORD * facet + 12;
    for (let value = 0; value < 9; value++) corners[9 * facet + value] = view.getFloat32(from + 4 * value, true);
  }
  return corners;
}

function text(bytes: ArrayBuffer): Float32Array {
  const found: number[] = [];
  for (const [, x, y, z] of new TextDecoder().decode(bytes).matchAll(VERTEX)) found.push(Number(x), Number(y), Number(z));
  return Float32Array.from(found);
}

/** The sides of a model in mm if its numbers are in a unit. */
export const sidesOf = ({ size }: Model, unit: Unit): number[] => size.map((side) => side * UNITS[unit]);

const likely = (model: Model, unit: Unit): boolean => {
  const largest = Math.max(...sidesOf(model, unit));
  return largest >= SMALLEST && largest <= LARGEST;
};

/** Units in which a model would have a likely size, where it has none in the given one; null where it has. */
export function likelier(model: Model, unit: Unit): Unit[] | null {
  if (likely(model, unit)) return null;
  return (Object.keys(UNITS) as Unit[]).filter((each) => likely(model, each));
}
