import {
  BufferGeometry,
  Color,
  Float32BufferAttribute,
  LoadingManager,
  Material,
  Matrix4,
  Mesh,
  MeshLambertMaterial,
  MeshPhongMaterial,
  Object3D,
  Vector3,
} from "three";
import type { Raycaster } from "three";
import { STLLoader } from "three/examples/jsm/loaders/STLLoader.js";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import URDFLoader, { type URDFJoint, type URDFMimicJoint, type URDFRobot } from "urdf-loader";
import type { Axis, Motion } from "./motion";

const MM = 1e-3;
const DEG = Math.PI / 180;

const SOLID = new MeshLambertMaterial({ vertexColors: true });
const GHOST = new MeshLambertMaterial({ vertexColors: true, transparent: true, opacity: 0.11 });
// Of translucent parts only the nearest surface is drawn, so their depth is drawn first.
const DEPTH = new MeshLambertMaterial({ vertexColors: true, transparent: true, colorWrite: false });
// After all of the work, and the head before the frame.
const ORDER = { head: 10, frame: 20 };

/** How a part of a machine is drawn: as it is, faintly so that the work is visible, or not at all. */
export type Look = "solid" | "ghost" | "hidden";

/** A machine's model: one mesh per link, with the joints set by the axes. Metres. */
export class Machine3D {
  /** Pose of every node in its parent with all joints at zero. */
  private readonly still = new Map<Object3D, Matrix4>();
  /** Meshes carried by the revolute joints, and all others. */
  private readonly head: Piece[] = [];
  private readonly frames: Piece[] = [];

  private constructor(readonly robot: URDFRobot) {
    robot.traverse((node) => {
      node.updateMatrix();
      this.still.set(node, node.matrix.clone());
      if (node instanceof Mesh) this.pieces(node).push(new Piece(node));
    });
    for (const piece of this.head) piece.order(ORDER.head);
    for (const piece of this.frames) piece.order(ORDER.frame);
  }

  /**
   * Builds a machine from its URDF.
   *
   * @param mesh bytes of an STL that the model names.
   * @param onMissing called for every mesh that cannot be shown, with the reason.
   */
  static async of(
    urdf: string,
    mesh: (name: string) => Promise<ArrayBuffer>,
    onMissing: (name: string, reason: string) => void,
  ): Promise<Machine3D> {
    const pending: Promise<void>[] = [];
    const loader = new URDFLoader(new LoadingManager());
    loader.packages = () => "";
    loader.loadMeshCb = (path, _, material, done) => {
      const name = path.replace(/^.*\//, "");
      const loading = mesh(name).then((bytes) => done(new Mesh(new STLLoader().parse(bytes), material)));
      pending.push(loading.catch((error: unknown) => onMissing(name, String(error))));
    };
    const robot = loader.parse(urdf);
    await Promise.all(pending);
    for (const link of Object.values(robot.links)) merge(link);
    // A setup may allow more travel than the model's file.
    for (const joint of Object.values(robot.joints)) joint.ignoreLimits = true;
    return new Machine3D(robot);
  }

  /** Sets the axes to a fraction of the motion to a row. */
  pose(motion: Motion, row: number, done: number): void {
    motion.axes.forEach((axis, index) => {
      this.robot.joints[axis.name]?.setJointValue(motion.drawn(index, row, done) * scaleOf(axis));
    });
  }

  /** Sets a joint that is not an axis of the program, in metres or radians. */
  set(joint: string, value: number): void {
    this.robot.joints[joint]?.setJointValue(value);
  }

  /** Draws the frame and the head in their looks. */
  dress(frame: Look, head: Look): void {
    for (const piece of this.frames) piece.dress(frame);
    for (const piece of this.head) piece.dress(head);
  }

  /** Whether a solid part is nearer to a ray's origin than a distance in metres. */
  hides(raycaster: Raycaster, distance: number): boolean {
    const solid = this.robot.visible ? [...this.frames, ...this.head].filter(({ look }) => look === "solid") : [];
    return solid.some(({ mesh }) => raycaster.intersectObject(mesh, false).some((met) => met.distance < distance));
  }

  frame(name: string): Object3D | undefined {
    return this.robot.frames[name];
  }

  /** Position of a frame in the machine at every row, (rows, 3) metres. */
  path(frame: string, motion: Motion): Float32Array {
    const chain = this.chain(frame);
    const steps = chain.map((node) => ({
      fixed: this.still.get(node)!,
      ...driveOf(node, motion),
    }));
    const places = new Float32Array(3 * motion.rows);
    const [pose, turn, point] = [new Matrix4(), new Matrix4(), new Vector3()];
    for (let row = 0; row < motion.rows; row++) {
      pose.identity();
      for (const { fixed, axis, along, factor, offset, turns } of steps) {
        pose.multiply(fixed);
        if (axis < 0) continue;
        const value = motion.drawn(axis, row, 1) * factor + offset;
        if (turns) pose.multiply(turn.makeRotationAxis(along, value));
        else pose.multiply(turn.makeTranslation(along.x * value, along.y * value, along.z * value));
      }
      point.setFromMatrixPosition(pose).toArray(places, 3 * row);
    }
    return places;
  }

  dispose(): void {
    this.robot.traverse((node) => {
      if (node instanceof Mesh) node.geometry.dispose();
    });
  }

  private pieces(mesh: Object3D): Piece[] {
    for (let node: Object3D | null = mesh; node; node = node.parent) if (isJoint(node) && turns(node)) return this.head;
    return this.frames;
  }

  private chain(frame: string): Object3D[] {
    const nodes: Object3D[] = [];
    for (let node = this.frame(frame) ?? null; node && node !== this.robot; node = node.parent) nodes.unshift(node);
    return nodes;
  }
}

/** A link's mesh, and a copy that only writes its depth while it is translucent. */
class Piece {
  look: Look = "solid";
  private readonly depth: Mesh;

  constructor(readonly mesh: Mesh) {
    this.depth = new Mesh(mesh.geometry, DEPTH);
  }

  order(order: number): void {
    this.depth.renderOrder = order;
    this.mesh.renderOrder = order + 1;
    this.mesh.add(this.depth);
    this.dress("solid");
  }

  dress(look: Look): void {
    this.look = look;
    this.mesh.visible = look !== "hidden";
    this.mesh.material = look === "ghost" ? GHOST : SOLID;
    this.depth.visible = look === "ghost";
  }
}

interface Drive {
  axis: number;
  along: Vector3;
  factor: number;
  offset: number;
  turns: boolean;
}

const isJoint = (node: Object3D): node is URDFJoint => "isURDFJoint" in node;
const isMimic = (node: URDFJoint): node is URDFMimicJoint => "mimicJoint" in node;

const turns = (joint: URDFJoint): boolean => joint.jointType === "revolute" || joint.jointType === "continuous";

function scaleOf(axis: Axis): number {
  return axis.revolute ? DEG : MM;
}

/** How the program's axes move a node; axis -1 if none does. */
function driveOf(node: Object3D, motion: Motion): Drive {
  const still = { axis: -1, along: new Vector3(), factor: 1, offset: 0, turns: false };
  if (!isJoint(node) || node.jointType === "fixed") return still;
  const mimic = isMimic(node);
  const axis = motion.axes.findIndex(({ name }) => name === (mimic ? node.mimicJoint : node.urdfName));
  if (axis < 0) return still;
  return {
    axis,
    along: node.axis,
    factor: scaleOf(motion.axes[axis]!) * (mimic ? node.multiplier : 1),
    offset: mimic ? node.offset : 0,
    turns: turns(node),
  };
}

/** Merges the visuals of a link into one mesh, keeping their colours. */
function merge(link: Object3D): void {
  const parts: BufferGeometry[] = [];
  for (const visual of link.children.filter((child) => "isURDFVisual" in child)) {
    visual.updateMatrixWorld(true);
    const toLink = new Matrix4().copy(link.matrixWorld).invert();
    visual.traverse((node) => {
      if (node instanceof Mesh) parts.push(coloured(node, toLink));
    });
    link.remove(visual);
  }
  if (parts.length) link.add(new Mesh(mergeGeometries(parts), SOLID));
  for (const part of parts) part.dispose();
}

function coloured(mesh: Mesh<BufferGeometry, Material | Material[]>, toLink: Matrix4): BufferGeometry {
  const { geometry, material, matrixWorld } = mesh;
  const found = geometry.index ? geometry.toNonIndexed() : geometry.clone();
  for (const name of Object.keys(found.attributes)) {
    if (name !== "position" && name !== "normal") found.deleteAttribute(name);
  }
  found.applyMatrix4(new Matrix4().multiplyMatrices(toLink, matrixWorld));
  // A model's colours are in sRGB.
  const color = material instanceof MeshPhongMaterial ? material.color.clone() : new Color(0.6, 0.63, 0.66);
  color.convertSRGBToLinear();
  const count = found.getAttribute("position").count;
  const colours = new Float32Array(3 * count);
  for (let vertex = 0; vertex < count; vertex++) color.toArray(colours, 3 * vertex);
  return found.setAttribute("color", new Float32BufferAttribute(colours, 3));
}

