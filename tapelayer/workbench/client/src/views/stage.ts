import { Box3, Group, Vector3 } from "three";
import type { Raycaster } from "three";
import type { ProgramKind, Made } from "../data/types";
import { Laying } from "./laying";
import type { Machine3D } from "./machine3d";
import { type Motion, motionOf } from "./motion";
import type { Spot } from "./spot";
import { Spraying } from "./spraying";
import type { Colouring, Work } from "./work";

export type { Colouring } from "./work";

const WORKS: Record<ProgramKind, (made: Made, machine: Machine3D, motion: Motion) => Promise<Work>> = {
  lay: (made) => Laying.of(made),
  spray: (made, machine, motion) => Spraying.of(made, machine, motion),
};

/** Contents of the view: a machine and the work of a job. Metres, in the machine's axes. */
export class Stage {
  readonly object = new Group();
  /** Bounds of the work; empty without a job. */
  readonly work = new Box3();
  readonly motion: Motion | null;
  private made3d: Work | null = null;

  constructor(
    readonly machine: Machine3D,
    private readonly made: Made | null,
  ) {
    this.object.add(machine.robot);
    this.motion = made && motionOf(made);
  }

  /** Adds the job's work to the stage. */
  async furnish(): Promise<void> {
    if (!this.made || !this.motion) return;
    this.made3d = await WORKS[this.made.kind](this.made, this.machine, this.motion);
    this.object.add(this.made3d.object);
    this.work.union(this.made3d.box);
  }

  /** Shows the machine and the work at a time of the program, moving towards a row; coarser during motion. */
  at(row: number, time_s: number, moving: boolean): void {
    if (!this.motion?.rows) return;
    this.machine.pose(this.motion, row, this.motion.done(row, time_s));
    this.made3d?.show(time_s, row, moving);
  }

  /** Position of the tool. */
  tool(place: Vector3): Vector3 | null {
    const frame = this.machine.frame("contact") ?? this.machine.frame("P");
    return frame ? frame.getWorldPosition(place) : null;
  }

  select(course: number): void {
    this.made3d?.select(course);
  }

  /** The place that a ray hits of what is made by a time, unless the machine hides it. */
  hit(raycaster: Raycaster, time_s: number): Spot | null {
    const spot = this.made3d?.hit(raycaster, time_s) ?? null;
    return spot && this.machine.hides(raycaster, spot.distance) ? null : spot;
  }

  /** Whether there are lines of passes. */
  get lined(): boolean {
    return Boolean(this.made3d?.lines);
  }

  /** Shows or hides the machine with its head, and the lines of the passes. */
  reveal(machine: boolean, lines: boolean): void {
    this.machine.robot.visible = machine;
    if (this.made3d?.lines) this.made3d.lines.visible = lines;
  }

  /** What the work can be coloured by, the usual first. */
  get colourings(): readonly Colouring[] {
    return this.made3d?.colourings ?? [];
  }

  /** Colours the work; returns the colour scale if there is one, whose later changes are told. */
  colour(by: Colouring, changed: () => void): HTMLElement | null {
    return this.made3d?.colour(by, changed) ?? null;
  }

  dispose(): void {
    this.object.removeFromParent();
    this.machine.dispose();
    this.made3d?.dispose();
  }
}
