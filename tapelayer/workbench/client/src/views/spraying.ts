import { Box3, Group, type Mesh } from "three";
import type { Raycaster } from "three";
import type { Made, Table } from "../data/types";
import { h } from "../elements";
import { t } from "../i18n";
import { COAT, inDigits, legend, legendOfSpeed, scaleOf } from "./legend";
import type { Machine3D } from "./machine3d";
import type { Motion } from "./motion";
import { type Spot, Track } from "./spot";
import { Coat, Passes, sprayCone } from "./spray3d";
import { type Colouring, MM, numberOf, partOf, type Work } from "./work";

// The coarsened part may cover the coat by this much, metres.
const THROUGH = 5e-3;

/** The part with the passes and the growing coat on it, and the spray cone. */
export class Spraying implements Work {
  readonly object = new Group();
  readonly box = new Box3();
  readonly colourings: readonly Colouring[];
  readonly lines: Group;
  private readonly part: ReturnType<typeof partOf>;
  private readonly passes: Passes;
  private readonly coat: Coat | null;
  private readonly cone: Mesh | null = null;
  private readonly track: Track | null;
  /** Farther than this from every pass, a place belongs to none; metres. */
  private readonly reach: number;
  /** Of the gun, mm/s. */
  private readonly speed: number;
  private by: Colouring = "coat";

  private constructor(
    made: Made,
    machine: Machine3D,
    private readonly motion: Motion,
    part: Table | null,
    coat: Table | null,
    errors: Table | null,
    points: Table | null,
  ) {
    this.track = errors && points && new Track(errors, points, "pass");
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
    this.reach = spot / 2;
    if (working && spot > 0) {
      this.cone = sprayCone(standoff, spot);
      working.add(this.cone);
    }
    const set = numberOf(made.setup, "spray", "speed_mm_per_s", 0);
    this.speed = numberOf(made.setup, "process", "relative_speed_mm_per_s", set);
    this.coat = coat?.rows ? new Coat(coat) : null;
    this.colourings = [...(this.coat ? (["coat"] as const) : []), ...(errors?.rows ? (["speed"] as const) : [])];
    if (this.coat) this.object.add(this.coat.object);
  }

  static async of(made: Made, machine: Machine3D, motion: Motion): Promise<Spraying> {
    const names = ["part", "coat", "errors", "points"] as const;
    const [part, coat, errors, points] = await Promise.all(names.map((name) => made.table(name)));
    return new Spraying(made, machine, motion, part!, coat!, errors!, points!);
  }

  show(time_s: number, row: number): void {
    this.coat?.show(time_s);
    this.passes.show(time_s);
    if (this.cone) this.cone.visible = this.motion.isOn("arc", row);
  }

  select(pass: number): void {
    this.passes.select(pass);
  }

  hit(raycaster: Raycaster, time_s: number): Spot | null {
    const { coat, track } = this;
    const met = coat?.hit(raycaster) ?? null;
    if (!coat || !met || !track) return null;
    const hidden = this.part && raycaster.intersectObject(this.part, false)[0];
    if (hidden && hidden.distance < met.distance - THROUGH) return null;
    // Samples do not know which of their sides is up, but the gun comes from above.
    if (met.normal.z < 0) met.normal.negate();
    const near = this.passes.near(met.place, met.normal, time_s, this.reach);
    const along = near ? track.along(near.pass, near.time) : Number.NaN;
    const speed = near && { what: "speed", value: track.at("speed_mm_per_s", near.pass, along) };
    const thickness = coat.bare(met.value) ? { what: "bare", value: 0 } : { what: coat.unit, value: met.value };
    return {
      ...{ place: met.place, distance: met.distance, along },
      course: near?.pass ?? 0,
      point: near ? track.point(near.pass, along) : 0,
      across: near ? near.across / MM : Number.NaN,
      time: near?.time ?? Number.NaN,
      measured: this.by === "speed" ? speed : thickness,
    };
  }

  colour(by: Colouring, changed: () => void): HTMLElement | null {
    const { coat, passes, speed, track } = this;
    this.by = by;
    // Two scales at once would be read as one.
    if (coat) coat.object.visible = by === "coat";
    passes.colourBy(by === "speed" && track ? (time_s) => track.when("speed_mm_per_s", time_s) : null, speed);
    if (by === "speed") return legendOfSpeed(speed);
    return coat && this.legendOfCoat(coat, changed);
  }

  dispose(): void {
    this.coat?.dispose();
    this.passes.dispose();
    this.part?.geometry.dispose();
    this.cone?.geometry.dispose();
  }

  private legendOfCoat(coat: Coat, changed: () => void): HTMLElement {
    let scale = scaleOfCoat(coat);
    const set = (): void => {
      const [target, part] = [Number(middle.value), Number(sides.value) / 100];
      coat.scale(middle.value && target > 0 ? target : null, part > 0 && part <= 1 ? part : coat.span);
      // The fields stay, since one of them has the focus.
      const next = scaleOfCoat(coat);
      scale.replaceWith(next);
      scale = next;
      changed();
    };
    const middle = number("coat-target", "scene.target.about", coat.centre === coat.mean ? "" : String(coat.centre), set);
    const sides = number("coat-span", "scene.span.about", inPercent(coat.span), set);
    middle.placeholder = inDigits(coat.mean);
    const fields = h("div", { class: "fields" }, h("label", {}, t("scene.target"), middle), h("label", {}, "± %", sides));
    return legend(scale, fields);
  }
}

function scaleOfCoat({ low, mean, high, unit, centre, span: share }: Coat): HTMLElement {
  const span = inPercent(share);
  const around = t(centre === mean ? "scene.mean" : "scene.target");
  const ticks = [`${inDigits(low)}\n−${span} %`, `${inDigits(centre)}\n${around}`, `${inDigits(high)}\n+${span} %`];
  const notes = {
    bare: t("scene.bare"),
    under: t("scene.under", { around, span }),
    beyond: t("scene.over", { around, span }),
  };
  return scaleOf(COAT, { title: t(`scene.thickness.${unit}`), ticks, notes });
}

const inPercent = (share: number): string => String(Number((100 * share).toFixed(3)));

function number(testid: string, title: string, value: string, onchange: () => void): HTMLInputElement {
  const props = { type: "number", min: 0, step: "any", tTitle: title, tLabel: title };
  const input = h("input", { ...props, testid, onchange });
  input.value = value;
  return input;
}
