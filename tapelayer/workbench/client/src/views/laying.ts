import { Box3, Group } from "three";
import type { Raycaster } from "three";
import type { Made, Table } from "../data/types";
import { t } from "../i18n";
import { ERRORS, inDigits, legend, legendOfSpeed, scaleOf } from "./legend";
import { Ribbons } from "./ribbons";
import { type Spot, Track } from "./spot";
import { type Colouring, numberOf, partOf, type Work } from "./work";

/** The tape as it is laid, on its mould if there is one. */
export class Laying implements Work {
  readonly object = new Group();
  readonly box = new Box3();
  readonly lines = null;
  private readonly ribbons: Ribbons | null;
  private readonly part: ReturnType<typeof partOf>;
  private readonly track: Track | null;
  private by: Colouring = "course";

  private constructor(
    private readonly made: Made,
    part: Table | null,
    tape: Table | null,
    private readonly errors: Table | null,
    points: Table | null,
  ) {
    this.track = errors && points && new Track(errors, points, "course");
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
    const names = ["part", "tape", "errors", "points"] as const;
    const [part, tape, errors, points] = await Promise.all(names.map((name) => made.table(name)));
    return new Laying(made, part!, tape!, errors!, points!);
  }

  get colourings(): readonly Colouring[] {
    return this.ribbons && this.errors?.rows ? ["course", "error", "speed"] : [];
  }

  show(time_s: number, _row: number, moving: boolean): void {
    this.ribbons?.show(time_s, moving);
  }

  select(course: number): void {
    this.ribbons?.select(course);
  }

  hit(raycaster: Raycaster, time_s: number): Spot | null {
    const struck = this.ribbons?.hit(raycaster.ray, time_s);
    const { track } = this;
    if (!struck || !track) return null;
    const { course, along } = struck;
    const [what, column] = this.by === "speed" ? ["speed", "speed_mm_per_s"] : ["error", "position_error_mm"];
    const measured = { what: what!, value: track.at(column!, course, along) };
    return { ...struck, point: track.point(course, along), time: track.at("time_s", course, along), measured };
  }

  colour(by: Colouring): HTMLElement | null {
    const { errors, ribbons } = this;
    this.by = by;
    if (!ribbons) return null;
    if (by === "error" && errors) return this.colourByError(ribbons, errors);
    if (by === "speed" && errors) return this.colourBySpeed(ribbons, errors);
    ribbons.colourByCourse();
    return null;
  }

  dispose(): void {
    this.ribbons?.dispose();
    this.part?.geometry.dispose();
  }

  private colourBySpeed(ribbons: Ribbons, table: Table): HTMLElement {
    const set = numberOf(this.made.setup, "process", "lay_speed_mm_per_s", 0);
    // Above the set speed the colour stays; the least around a place tells of a stop between two others.
    ribbons.colourBy(table.column("time_s"), table.column("speed_mm_per_s"), set, Infinity, Math.min);
    return legendOfSpeed(set);
  }

  private colourByError(ribbons: Ribbons, table: Table): HTMLElement {
    const errors = table.column("position_error_mm");
    const limit = numberOf(this.made.setup, "verification", "max_position_error_mm", Infinity);
    const greatest = errors.reduce((most, error) => (error > most ? error : most), 0);
    // Jobs are comparable only where the scale ends at the limit.
    const most = Number.isFinite(limit) ? limit : greatest;
    ribbons.colourBy(table.column("time_s"), errors, most, limit, Math.max);
    const ticks = [0, most / 2, most].map(inDigits);
    const notes: Record<string, string> = greatest <= limit ? {} : { beyond: t("scene.beyond") };
    return legend(scaleOf(ERRORS, { title: t("scene.error"), ticks, notes }));
  }
}
