import type { Kind, ProgramKind } from "./types";

/** Everything the page knows about a kind of job before its results arrive; no other code compares kinds. */
export interface KindOfJob {
  /** The built-in machine; null where there is none. */
  machine: string | null;
  /** The parts of what is made, courses or passes: the ending of its text keys. */
  part: "course" | "pass";
  /** Whether its source is a model, rather than a course file. */
  model: boolean;
  /** Whether the unit of a source must be given; it is told beside the setup unless the setup has the source. */
  unit: boolean;
  /** The section of the setup that has the source's `file` and `unit`, which the form has not; null for none. */
  source: string | null;
  /** Whether a mould can be sent along. */
  mould: boolean;
  /** Whether there is a coat to plot. */
  coat: boolean;
  /** Whether its parameters are drawn on the model. */
  drawn: boolean;
  /** The kind whose programs are made from what this one makes; null for kinds that make programs. */
  next: ProgramKind | null;
}

const PROGRAM = { unit: false, source: null, mould: false, coat: false, drawn: false, next: null };

export const KINDS: Record<Kind, KindOfJob> = {
  lay: { ...PROGRAM, machine: "tapelayer", part: "course", model: false, mould: true },
  plan: {
    ...{ machine: null, part: "course", model: true, unit: true, source: "mould" },
    ...{ mould: false, coat: false, drawn: true, next: "lay" },
  },
  spray: { ...PROGRAM, machine: "sprayer", part: "pass", model: true, unit: true, coat: true },
};
export const NAMES = Object.keys(KINDS) as Kind[];
export const FIRST: ProgramKind = "lay";
/** The kind of job that a model is for unless another is chosen. */
export const OF_MODELS: Kind = "spray";
