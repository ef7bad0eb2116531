import { lowerBound } from "../views/motion";

/**
 * Rows of curves over time that suffice for a plot of `columns` pixels: in each pixel column the first, the last, and
 * the lowest and highest of every curve, so that no peak is lost; and one row beyond either end.
 */
export function thinnedRows(
  times: Float32Array,
  curves: Float32Array[],
  low: number,
  high: number,
  columns: number,
): number[] {
  const from = Math.max(lowerBound(times, low) - 1, 0);
  const to = Math.min(lowerBound(times, high) + 1, times.length);
  if (to - from <= 2 * columns) return Array.from({ length: to - from }, (_, index) => from + index);
  const scale = columns / (high - low);
  const rows: number[] = [];
  for (let begin = from; begin < to; ) {
    const column = Math.floor((times[begin]! - low) * scale);
    let end = begin + 1;
    while (end < to && Math.floor((times[end]! - low) * scale) === column) end++;
    const kept = new Set([begin, end - 1]);
    for (const curve of curves) for (const row of extremes(curve, begin, end)) kept.add(row);
    rows.push(...[...kept].sort((one, other) => one - other));
    begin = end;
  }
  return rows;
}

/** Rows of the lowest and highest value of a curve, and of a NaN, so that gaps are not lost either. */
function extremes(curve: Float32Array, begin: number, end: number): number[] {
  let least = -1;
  let greatest = -1;
  let gap = -1;
  for (let row = begin; row < end; row++) {
    const value = curve[row]!;
    if (Number.isNaN(value)) gap = row;
    else {
      if (least < 0 || value < curve[least]!) least = row;
      if (greatest < 0 || value > curve[greatest]!) greatest = row;
    }
  }
  return [least, greatest, gap].filter((row) => row >= 0);
}
