import type { Kind } from "./types";

/** Everything the page knows about a kind of machine before its results arrive; no other code compares kinds. */
export interface KindOfJob {
  /** The built-in machine. */
  machine: string;
  /** The parts of a program, courses or passes: the ending of its text keys. */
  part: "course" | "pass";
  /** Pattern for names of its source files; null for the kind that takes all other files. */
  source: RegExp | null;
  /** Whether the unit of a source must be given. */
  unit: boolean;
  /** Whether a mould can be sent along. */
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

/** The kind of job for a file name. */
export function kindOfSource(name: string): Kind {
  return NAMES.find((kind) => KINDS[kind].source?.test(name)) ?? FIRST;
}
