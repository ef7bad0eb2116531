import { AxesHelper, Box3, BufferAttribute, BufferGeometry, DoubleSide, Group, Mesh, MeshLambertMaterial, Vector3 } from "three";
import type { Raycaster } from "three";
import { toCreasedNormals } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import { COAT, ERRORS, legend } from "./legend";
import type { Machine3D } from "./machine3d";
import { type Motion, motionOf } from "./motion";
import type { Made, SetupValues, Table } from "./panels";
import { Ribbons } from "./ribbons";
import { Coat, Passes, pointsOf, sprayCone } from "./spray3d";

const MM = 1e-3;
// Edges that are sharper than this stay sharp to the eye, radians.
const CREASE = 0.6;

export type Colouring = "course" | "error";

/** What stands in the view: a machine, and what a job makes with it. Metres, in the machine's axes. */
export class Stage {
  readonly object = new Group();
  /** What is made; empty without a job. */
  readonly work = new Box3();
  readonly motion: Motion | null;
  private ribbons: Ribbons | null = null;
  private errors: Table | null = null;
  private coat: Coat | null = null;
  private passes: Passes | null = null;
  private cone: Mesh | null = null;
  private part: Mesh<BufferGeometry, MeshLambertMaterial> | null = null;

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
    const { made } = this;
    const part = made.table("part");
    if (made.kind === "spray") {
      const coat = await made.table("coat");
      this.addPart(await part);
      this.furnishSpraying(coat, this.motion);
      return;
    }
    const [tape, errors] = await Promise.all([made.table("tape"), made.table("errors")]);
    this.addPart(await part);
    this.errors = errors;
    if (!tape?.rows) return;
    this.ribbons = new Ribbons(tape);
    this.object.add(this.ribbons.object);
    this.work.union(this.ribbons.box);
  }

  /** Puts the machine and what it made where they are at a time of the program, on the way to a row; coarser while moving. */
  at(row: number, time_s: number, moving: boolean): void {
    if (!this.motion?.rows) return;
    this.machine.pose(this.motion, row, this.motion.done(row, time_s));
    this.ribbons?.show(time_s, moving);
    this.coat?.show(time_s);
    if (this.cone) this.cone.visible = this.motion.isOn("arc", row);
  }

  /** Place of the tool. */
  tool(place: Vector3): Vector3 | null {
    const frame = this.machine.frame("contact") ?? this.machine.frame("P");
    return frame ? frame.getWorldPosition(place) : null;
  }

  select(course: number): void {
    this.ribbons?.select(course);
    this.passes?.select(course);
  }

  /** Number of the course or pass under a ray; 0 for none. */
  hit(raycaster: Raycaster): number {
    return this.ribbons?.hit(raycaster.ray) ?? this.passes?.hit(raycaster) ?? 0;
  }

  /** Whether the tape can be coloured by its errors. */
  get measured(): boolean {
    return this.ribbons !== null && (this.errors?.rows ?? 0) > 0;
  }

  /** Colours what was made; gives the scale of the colours where they have one. */
  colour(by: Colouring): HTMLElement | null {
    if (this.coat) {
      const { most, thicker, unit } = this.coat;
      return legend(COAT, most, `scene.thickness.${unit}`, { open: thicker });
    }
    if (!this.ribbons) return null;
    if (by === "course" || !this.errors) {
      this.ribbons.colourByCourse();
      return null;
    }
    const errors = this.errors.column("position_error_mm");
    const limit = numberOf(this.made!.setup, "verification", "max_position_error_mm", Infinity);
    const greatest = errors.reduce((most, error) => (error > most ? error : most), 0);
    const most = Math.min(greatest, limit);
    this.ribbons.colourBy(this.errors.column("time_s"), errors, most, limit);
    return legend(ERRORS, most, "scene.error", { note: greatest <= limit ? "" : "scene.beyond" });
  }

  dispose(): void {
    this.object.removeFromParent();
    this.machine.dispose();
    for (const piece of [this.ribbons, this.coat, this.passes]) piece?.dispose();
    for (const mesh of [this.part, this.cone]) mesh?.geometry.dispose();
  }

  private addPart(table: Table | null): void {
    if (!table?.rows) return;
    const sprayed = this.made!.kind === "spray";
    const soup = new BufferGeometry().setAttribute("position", new BufferAttribute(pointsOf(table), 3));
    const material = new MeshLambertMaterial({
      ...{ color: sprayed ? 0x969ca2 : 0xa9b6c2, side: DoubleSide },
      // What is made on a part stays in sight where the part is drawn coarser than it is; and one sees through a mould.
      ...{ transparent: !sprayed, opacity: sprayed ? 1 : 0.55, depthWrite: sprayed },
      ...{ polygonOffset: true, polygonOffsetFactor: 6, polygonOffsetUnits: 128 },
    });
    this.part = new Mesh(toCreasedNormals(soup, CREASE), material);
    this.object.add(this.part);
    this.work.expandByObject(this.part);
  }

  private furnishSpraying(coat: Table | null, motion: Motion): void {
    const { report, setup } = this.made!;
    const standoff = Number(report.standoff_mm) * MM;
    this.machine.set("standoff", standoff);
    this.passes = new Passes(this.machine, motion);
    this.object.add(this.passes.object);
    const working = this.machine.frame("P");
    const spot = numberOf(setup, "spray", "spot_mm", 0) * MM;
    if (working && spot > 0) {
      this.cone = sprayCone(standoff, spot);
      working.add(this.cone);
    }
    if (coat?.rows) {
      this.coat = new Coat(coat);
      this.object.add(this.coat.object);
    }
  }
}

function numberOf(setup: SetupValues, section: string, key: string, otherwise: number): number {
  const value = setup[section]?.[key];
  return typeof value === "number" ? value : otherwise;
}
