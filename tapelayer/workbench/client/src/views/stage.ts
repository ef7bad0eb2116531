import { AxesHelper, Box3, Group, Vector3 } from "three";
import type { Raycaster } from "three";
import type { Kind, Made } from "../data/types";
import { Laying } from "./laying";
import type { Machine3D } from "./machine3d";
import { type Motion, motionOf } from "./motion";
import { Spraying } from "./spraying";
import type { Colouring, Work } from "./work";

export type { Colouring } from "./work";

const WORKS: Record<Kind, (made: Made, machine: Machine3D, motion: Motion) => Promise<Work>> = {
  lay: (made) => Laying.of(made),
  spray: (made, machine, motion) => Spraying.of(made, machine, motion),
};

/** What stands in the view: a machine, and what a job makes with it. Metres, in the machine's axes. */
export class Stage {
  readonly object = new Group();
  /** What is made; empty without a job. */
  readonly work = new Box3();
  readonly motion: Motion | null;
  private made3d: Work | null = null;

  constructor(
    readonly machine: Machine3D,
    private readonly made: Made | null,
  ) {
    this.object.add(machine.robot, new AxesHelper(0.25));
    this.motion = made && motionOf(made);
  }

  /** Gets what the job made onto the stage. */
  async furnish(): Promise<void> {
    if (!this.made || !this.motion) return;
    this.made3d = await WORKS[this.made.kind](this.made, this.machine, this.motion);
    this.object.add(this.made3d.object);
    this.work.union(this.made3d.box);
  }

  /** Puts the machine and what it made where they are at a time of the program, on the way to a row; coarser while moving. */
  at(row: number, time_s: number, moving: boolean): void {
    if (!this.motion?.rows) return;
    this.machine.pose(this.motion, row, this.motion.done(row, time_s));
    this.made3d?.show(time_s, row, moving);
  }

  /** Place of the tool. */
  tool(place: Vector3): Vector3 | null {
    const frame = this.machine.frame("contact") ?? this.machine.frame("P");
    return frame ? frame.getWorldPosition(place) : null;
  }

  select(course: number): void {
    this.made3d?.select(course);
  }

  /** Number of the course or pass under a ray; 0 for none. */
  hit(raycaster: Raycaster): number {
    return this.made3d?.hit(raycaster) ?? 0;
  }

  /** Whether what was made can be coloured by its errors. */
  get measured(): boolean {
    return this.made3d?.measured ?? false;
  }

  /** Colours what was made; gives the scale of the colours where they have one. */
  colour(by: Colouring): HTMLElement | null {
    return this.made3d?.colour(by) ?? null;
  }

  dispose(): void {
    this.object.removeFromParent();
    this.machine.dispose();
    this.made3d?.dispose();
  }
}
