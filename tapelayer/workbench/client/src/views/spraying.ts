import { Box3, Group, type Mesh } from "three";
import type { Raycaster } from "three";
import type { Made, Table } from "../data/types";
import { COAT, inDigits, legend } from "./legend";
import type { Machine3D } from "./machine3d";
import type { Motion } from "./motion";
import { Coat, Passes, sprayCone } from "./spray3d";
import { MM, numberOf, partOf, type Work } from "./work";

/** The part with the passes and the growing coat on it, and the spray cone. */
export class Spraying implements Work {
  readonly object = new Group();
  readonly box = new Box3();
  readonly measured = false;
  readonly lines: Group;
  private readonly part: ReturnType<typeof partOf>;
  private readonly passes: Passes;
  private readonly coat: Coat | null;
  private readonly cone: Mesh | null = null;

  private constructor(
    made: Made,
    machine: Machine3D,
    private readonly motion: Motion,
    part: Table | null,
    coat: Table | null,
  ) {
    this.part = partOf(part, { solid: true });
    if (this.part) {
      this.object.add(this.part);
      this.box.expandByObject(this.part);
    }
    const standoff = Number(made.report["standoff_mm"]) * MM;
    machine.set("standoff", standoff);
    this.passes = new Passes(machine, motion);
    this.lines = this.passes.object;
    this.object.add(this.lines);
    const working = machine.frame("P");
    const spot = numberOf(made.setup, "spray", "spot_mm", 0) * MM;
    if (working && spot > 0) {
      this.cone = sprayCone(standoff, spot);
      working.add(this.cone);
    }
    this.coat = coat?.rows ? new Coat(coat) : null;
    if (this.coat) this.object.add(this.coat.object);
  }

  static async of(made: Made, machine: Machine3D, motion: Motion): Promise<Spraying> {
    const [part, coat] = await Promise.all([made.table("part"), made.table("coat")]);
    return new Spraying(made, machine, motion, part, coat);
  }

  show(time_s: number, row: number): void {
    this.coat?.show(time_s);
    if (this.cone) this.cone.visible = this.motion.isOn("arc", row);
  }

  select(pass: number): void {
    this.passes.select(pass);
  }

  hit(raycaster: Raycaster): number {
    return this.passes.hit(raycaster);
  }

  colour(): HTMLElement | null {
    if (!this.coat) return null;
    const { low, mean, high, unit } = this.coat;
    const ticks = [`${inDigits(low)}\n−20 %`, inDigits(mean), `${inDigits(high)}\n+20 %`];
    const notes = { bare: "scene.bare", under: "scene.under", beyond: "scene.over" };
    return legend(COAT, ticks, `scene.thickness.${unit}`, notes);
  }

  dispose(): void {
    this.coat?.dispose();
    this.passes.dispose();
    this.part?.geometry.dispose();
    this.cone?.geometry.dispose();
  }
}
