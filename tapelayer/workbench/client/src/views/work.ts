import { BufferAttribute, BufferGeometry, DoubleSide, Mesh, MeshLambertMaterial } from "three";
import type { Box3, Object3D, Raycaster } from "three";
import { toCreasedNormals } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import type { SetupValues, Table } from "../data/types";
import type { Spot } from "./spot";
import { pointsOf } from "./spray3d";

export const MM = 1e-3;
// Edges sharper than this are shaded as sharp, radians.
const CREASE = 0.6;

/** What the colours of the work tell. */
export type Colouring = "course" | "error" | "speed" | "coat";

/** The work of a machine as drawn: tape, or passes and coat. Metres, in the machine's axes. */
export interface Work {
  readonly object: Object3D;
  readonly box: Box3;
  /** Lines of the passes over the work; null for none. */
  readonly lines: Object3D | null;
  /** What it can be coloured by, the usual first. */
  readonly colourings: readonly Colouring[];
  /** Shows it at a time of the program, moving towards a row; coarser during motion. */
  show(time_s: number, row: number, moving: boolean): void;
  /** Highlights a course or pass; 0 for none. */
  select(number: number): void;
  /** The place that a ray hits of what is made by a time. */
  hit(raycaster: Raycaster, time_s: number): Spot | null;
  /** Colours it; returns the colour scale if there is one. Calls `changed` where the scale is changed later. */
  colour(by: Colouring, changed: () => void): HTMLElement | null;
  dispose(): void;
}

/** The part that is worked on; a mould is translucent. */
export function partOf(table: Table | null, { solid }: { solid: boolean }): Mesh<BufferGeometry, MeshLambertMaterial> | null {
  if (!table?.rows) return null;
  const soup = new BufferGeometry().setAttribute("position", new BufferAttribute(pointsOf(table), 3));
  const material = new MeshLambertMaterial({
    ...{ color: solid ? 0x969ca2 : 0xa9b6c2, side: DoubleSide },
    // The work must stay visible where the coarsened part would cover it.
    ...{ transparent: !solid, opacity: solid ? 1 : 0.55, depthWrite: solid },
    ...{ polygonOffset: true, polygonOffsetFactor: 6, polygonOffsetUnits: 128 },
  });
  return new Mesh(toCreasedNormals(soup, CREASE), material);
}

/** A numeric value of a setup. */
export function numberOf(setup: SetupValues, section: string, key: string, otherwise: number): number {
  const value = setup[section]?.[key];
  return typeof value === "number" ? value : otherwise;
}
