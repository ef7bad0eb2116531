import { BufferAttribute, BufferGeometry, DoubleSide, Mesh, MeshLambertMaterial } from "three";
import type { Box3, Object3D, Raycaster } from "three";
import { toCreasedNormals } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import type { SetupValues, Table } from "../data/types";
import { pointsOf } from "./spray3d";

export const MM = 1e-3;
// Edges that are sharper than this stay sharp to the eye, radians.
const CREASE = 0.6;

export type Colouring = "course" | "error";

/** What a machine makes, as it is drawn. Metres, in the machine's axes. */
export interface Work {
  readonly object: Object3D;
  readonly box: Box3;
  /** Whether it can be coloured by its errors. */
  readonly measured: boolean;
  /** Shows it as it is at a time of the program, on the way to a row; coarser while moving. */
  show(time_s: number, row: number, moving: boolean): void;
  /** Stresses a course or pass; none for 0. */
  select(number: number): void;
  /** Number of the course or pass under a ray; 0 for none. */
  hit(raycaster: Raycaster): number;
  /** Colours it; gives the scale of the colours where they have one. */
  colour(by: Colouring): HTMLElement | null;
  dispose(): void;
}

/** The part on which something is made; one sees through a mould. */
export function partOf(table: Table | null, { solid }: { solid: boolean }): Mesh<BufferGeometry, MeshLambertMaterial> | null {
  if (!table?.rows) return null;
  const soup = new BufferGeometry().setAttribute("position", new BufferAttribute(pointsOf(table), 3));
  const material = new MeshLambertMaterial({
    ...{ color: solid ? 0x969ca2 : 0xa9b6c2, side: DoubleSide },
    // What is made on a part stays in sight where the part is drawn coarser than it is.
    ...{ transparent: !solid, opacity: solid ? 1 : 0.55, depthWrite: solid },
    ...{ polygonOffset: true, polygonOffsetFactor: 6, polygonOffsetUnits: 128 },
  });
  return new Mesh(toCreasedNormals(soup, CREASE), material);
}

/** A number of a setup. */
export function numberOf(setup: SetupValues, section: string, key: string, otherwise: number): number {
  const value = setup[section]?.[key];
  return typeof value === "number" ? value : otherwise;
}
