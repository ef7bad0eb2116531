import { lasting } from "../data/quantities";
import type { ProgramKind, Made, Translate } from "../data/types";
import { h } from "../elements";
import { type Motion, motionOf } from "../views/motion";

/** What the machine does in a row, its duration aside. */
type PhaseOf = (motion: Motion, row: number) => string;

const SVG = "http://www.w3.org/2000/svg";
const TAPE = "u";
const STOP = "stop";

/** By the words of the program: laying is with the shoe down, threading feeds tape with the shoe up, a stop moves nothing. */
function layingPhase(motion: Motion, row: number): string {
  const { kinds, kind_names } = motion.blocks;
  const moves = (axis: number): boolean => motion.drawn(axis, row, 1) !== motion.drawn(axis, row - 1, 1);
  if (!motion.axes.some((_, axis) => moves(axis))) return STOP;
  if (motion.isOn("shoe", row - 1)) return "laying";
  const tape = motion.axes.findIndex(({ name }) => name === TAPE);
  return kind_names[kinds[row]!] === "linear" && tape >= 0 && moves(tape) ? "threading" : "link";
}

const sprayingPhase: PhaseOf = (motion, row) => (motion.isOn("arc", row - 1) ? "on" : "off");

// The phases of each kind, those drawn over the others last.
const PHASES: Record<ProgramKind, { names: string[]; of: PhaseOf }> = {
  lay: { names: ["link", "threading", "laying", STOP], of: layingPhase },
  spray: { names: ["off", "on"], of: sprayingPhase },
};

/** Begin and end of every stretch of time in each phase, seconds. */
function bandsOf(motion: Motion, kind: ProgramKind): Map<string, [begin: number, end: number][]> {
  const { names, of } = PHASES[kind];
  const bands = new Map(names.map((name) => [name, [] as [number, number][]]));
  let last: [number, number] = [0, 0];
  let phase = "";
  for (let row = 1; row < motion.rows; row++) {
    const [begin, end] = [motion.times[row - 1]!, motion.times[row]!];
    if (!(end > begin)) continue;
    const next = of(motion, row);
    if (next !== phase) bands.get(next)!.push((last = [begin, end]));
    last[1] = end;
    phase = next;
  }
  return bands;
}

/** When the tape stops while it is laid, most often for no time at all; seconds. */
function stopsOf({ report }: Made, motion: Motion): number[] {
  const stops = (report["stops"] ?? []) as { line: number | null }[];
  return stops.flatMap(({ line }) => (line ? [motion.times[motion.rowOfLine(line)]!] : []));
}

/** A ruler of the program's time: what the machine does when, and its legend. */
export class Ruler {
  readonly element = document.createElementNS(SVG, "svg");
  readonly legend = h("div", { class: "player-phases", testid: "phases" });

  constructor(private readonly t: Translate) {
    this.element.classList.add("player-ruler");
    this.element.dataset["testid"] = "ruler";
    this.element.setAttribute("preserveAspectRatio", "none");
    this.element.setAttribute("role", "img");
  }

  show(made: Made | null): void {
    this.element.replaceChildren();
    this.legend.replaceChildren();
    const motion = made && motionOf(made);
    const duration = motion?.duration ?? 0;
    this.element.setAttribute("viewBox", `0 0 ${duration || 1} 1`);
    if (!motion || !(duration > 0)) return;
    const stops = stopsOf(made, motion);
    const told: string[] = [];
    for (const [phase, bands] of bandsOf(motion, made.kind)) {
      const marks = phase === STOP ? stops : [];
      if (!bands.length && !marks.length) continue;
      const seconds = bands.reduce((sum, [begin, end]) => sum + end - begin, 0);
      const name = this.t(`player.phase.${phase}`);
      const parts = bands.length ? [lasting(seconds, 1), `${((100 * seconds) / duration).toFixed(1)} %`] : [];
      if (marks.length) parts.push(this.t("player.stops", { count: marks.length }));
      told.push(`${name}: ${parts.join(", ")}`);
      const along = bands.map(([begin, end]) => `M${written(begin)} .5H${written(end)}`);
      const across = marks.map((time_s) => `M${written(time_s)} 0V1`);
      this.element.append(drawn("band", phase, along), drawn("mark", phase, across));
      this.legend.append(h("span", { "data-phase": phase, title: told.at(-1)! }, name));
    }
    this.element.setAttribute("aria-label", `${this.t("player.ruler")}: ${told.join("; ")}`);
  }
}

const written = (time_s: number): string => time_s.toFixed(4);

function drawn(look: string, phase: string, pieces: string[]): SVGPathElement {
  const path = document.createElementNS(SVG, "path");
  path.classList.add(look);
  path.dataset["phase"] = phase;
  path.setAttribute("d", pieces.join(""));
  return path;
}
