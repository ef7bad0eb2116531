import { Box3, Group } from "three";
import type { Raycaster } from "three";
import type { Made, Table } from "../data/types";
import { ERRORS, inDigits, legend } from "./legend";
import { Ribbons } from "./ribbons";
import { type Colouring, numberOf, partOf, type Work } from "./work";

/** The tape as it is laid, on its mould if there is one. */
export class Laying implements Work {
  readonly object = new Group();
  readonly box = new Box3();
  readonly lines = null;
  private readonly ribbons: Ribbons | null;
  private readonly part: ReturnType<typeof partOf>;

  private constructor(
    private readonly made: Made,
    part: Table | null,
    tape: Table | null,
    private readonly errors: Table | null,
  ) {
    this.part = partOf(part, { solid: false });
    this.ribbons = tape?.rows ? new Ribbons(tape) : null;
    if (this.part) {
      this.object.add(this.part);
      this.box.expandByObject(this.part);
    }
    if (!this.ribbons) return;
    this.object.add(this.ribbons.object);
    this.box.union(this.ribbons.box);
  }

  static async of(made: Made): Promise<Laying> {
    const tables = await Promise.all([made.table("part"), made.table("tape"), made.table("errors")]);
    return new Laying(made, ...tables);
  }

  get measured(): boolean {
    return this.ribbons !== null && (this.errors?.rows ?? 0) > 0;
  }

  show(time_s: number, _row: number, moving: boolean): void {
    this.ribbons?.show(time_s, moving);
  }

  select(course: number): void {
    this.ribbons?.select(course);
  }

  hit(raycaster: Raycaster): number {
    return this.ribbons?.hit(raycaster.ray) ?? 0;
  }

  colour(by: Colouring): HTMLElement | null {
    if (!this.ribbons) return null;
    if (by === "course" || !this.errors) {
      this.ribbons.colourByCourse();
      return null;
    }
    const errors = this.errors.column("position_error_mm");
    const limit = numberOf(this.made.setup, "verification", "max_position_error_mm", Infinity);
    const greatest = errors.reduce((most, error) => (error > most ? error : most), 0);
    // Jobs are comparable only where the scale ends at the limit.
    const most = Number.isFinite(limit) ? limit : greatest;
    this.ribbons.colourBy(this.errors.column("time_s"), errors, most, limit);
    const ticks = [0, most / 2, most].map(inDigits);
    return legend(ERRORS, ticks, "scene.error", greatest <= limit ? {} : { beyond: "scene.beyond" });
  }

  dispose(): void {
    this.ribbons?.dispose();
    this.part?.geometry.dispose();
  }
}
