import { type Camera, Quaternion, Vector3 } from "three";

const SVG = "http://www.w3.org/2000/svg";
const AXES = [
  ["x", new Vector3(1, 0, 0)],
  ["y", new Vector3(0, 1, 0)],
  ["z", new Vector3(0, 0, 1)],
] as const;
// Lengths in the drawing, which is 2 wide and high around its origin.
const ARM = 0.62;
const LETTER = 0.84;

/** The machine's directions as the camera sees them, with their letters. */
export class Triad {
  readonly element = drawn("svg", { class: "scene-triad", viewBox: "-1 -1 2 2", role: "img", "data-t-label": "scene.directions" });
  private readonly arms = AXES.map(([name, axis]) => {
    const [line, text] = [drawn("line", {}), drawn("text", {})];
    const arm = drawn("g", { class: `axis-${name}`, "data-testid": `triad-${name}` });
    text.textContent = name;
    arm.append(line, text);
    return { arm, line, text, axis };
  });
  private readonly turn = new Quaternion();
  private readonly seen = new Vector3();

  constructor() {
    this.element.append(...this.arms.map(({ arm }) => arm));
  }

  /** Turns it as a camera looks. */
  show(camera: Camera): void {
    this.turn.copy(camera.quaternion).invert();
    const ways = this.arms.map(({ axis }) => this.seen.copy(axis).applyQuaternion(this.turn).toArray());
    this.arms.forEach(({ line, text }, index) => {
      const [right, up] = ways[index]!;
      place(line, { x2: ARM * right, y2: -ARM * up });
      place(text, { x: LETTER * right, y: -LETTER * up });
    });
    // What points towards the eye lies over the rest.
    const order = this.arms.map((_, index) => index).sort((one, other) => ways[one]![2] - ways[other]![2]);
    const arms = order.map((index) => this.arms[index]!.arm);
    if (arms.some((arm, index) => this.element.children[index] !== arm)) this.element.replaceChildren(...arms);
  }
}

function drawn(name: string, attributes: Record<string, string>): SVGElement {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

function place(element: SVGElement, at: Record<string, number>): void {
  for (const [key, value] of Object.entries(at)) element.setAttribute(key, value.toFixed(4));
}
