import type { Kind } from "./types";

/** What the page has to know of a kind of machine before its results are there; nothing else compares kinds. */
export interface KindOfJob {
  /** The machine that comes along. */
  machine: string;
  /** What a program is made of: the ending of its texts' keys. */
  part: "course" | "pass";
  /** Files that are its sources by their name; null where every other file is. */
  source: RegExp | null;
  /** Whether a source needs its unit told. */
  unit: boolean;
  /** Whether a mould can come along. */
  mould: boolean;
  /** Whether there is a coat to plot. */
  coat: boolean;
}

export const KINDS: Record<Kind, KindOfJob> = {
  lay: { machine: "tapelayer", part: "course", source: null, unit: false, mould: true, coat: false },
  spray: { machine: "sprayer", part: "pass", source: /\.stl$/i, unit: true, mould: false, coat: true },
};
export const NAMES = Object.keys(KINDS) as Kind[];
export const FIRST = NAMES[0]!;

/** The kind whose sources are named as a file is. */
export function kindOfSource(name: string): Kind {
  return NAMES.find((kind) => KINDS[kind].source?.test(name)) ?? FIRST;
}
