import { plain } from "../data/quantities";
import { h } from "../elements";
import { t } from "../i18n";

/** Colours of a scale as RGB bytes, from the lowest value to the highest. */
export type Ramp = Uint8Array;

const STEPS = 256;

/** Red for values beyond a limit. */
export const BEYOND: readonly [number, number, number] = [214, 39, 40];

/** A ramp through evenly spaced colours. */
function ramp(...stops: readonly [number, number, number][]): Ramp {
  const colours = new Uint8Array(3 * STEPS);
  for (let step = 0; step < STEPS; step++) {
    const place = (step / (STEPS - 1)) * (stops.length - 1);
    const low = Math.min(Math.floor(place), stops.length - 2);
    for (let part = 0; part < 3; part++) {
      const [from, to] = [stops[low]![part]!, stops[low + 1]![part]!];
      colours[3 * step + part] = Math.round(from + (to - from) * (place - low));
    }
  }
  return colours;
}

/** Viridis: perceptually uniform, and readable for the colour-blind. */
const VIRIDIS: readonly [number, number, number][] = [
  [68, 1, 84],
  [72, 40, 120],
  [62, 74, 137],
  [49, 104, 142],
  [38, 130, 142],
  [31, 158, 137],
  [53, 183, 121],
  [109, 205, 89],
  [180, 222, 44],
  [253, 231, 37],
];

export const ERRORS: Ramp = ramp(...VIRIDIS);

export const COAT: Ramp = ERRORS;

export const SPEEDS: Ramp = ERRORS;

/** Grey for no coat yet. */
export const BARE: readonly [number, number, number] = [150, 156, 162];

/** Pale blue for less than the scale's lower end. */
export const UNDER: readonly [number, number, number] = [166, 206, 240];

/** The colours of a ramp converted from sRGB to linear light, as the renderer expects them. */
export function linear(colours: ArrayLike<number>): Ramp {
  return Uint8Array.from(colours, (value) => {
    const share = value / 255;
    return Math.round(255 * (share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4));
  });
}

/** Index of a value's colour in a ramp that ends at `most`. */
export function placeOf(value: number, most: number): number {
  return 3 * Math.round(Math.min(Math.max(most > 0 ? value / most : 0, 0), 1) * (STEPS - 1));
}

/** A value as short as its size allows. */
export function inDigits(value: number): string {
  return value.toFixed(value === 0 || value >= 100 ? 0 : value >= 10 ? 1 : value >= 0.5 ? 2 : 4);
}

/** What a colour scale says; the notes by the class of the colour they name. */
export interface Said {
  title: string;
  ticks: string[];
  notes: Record<string, string>;
}

/** A labelled colour scale in its frame, with what else belongs below it. */
export function legend(scale: HTMLElement, ...below: HTMLElement[]): HTMLElement {
  return h("div", { class: "scene-legend", testid: "legend" }, scale, ...below);
}

/** A labelled colour scale. */
export function scaleOf(colours: Ramp, { title, ticks, notes }: Said): HTMLElement {
  const bar = h("canvas", { width: STEPS, height: 1, "aria-hidden": "true" });
  const context = bar.getContext("2d");
  if (context) {
    const image = context.createImageData(STEPS, 1);
    for (let step = 0; step < STEPS; step++) {
      image.data.set([...colours.subarray(3 * step, 3 * step + 3), 255], 4 * step);
    }
    context.putImageData(image, 0, 0);
  }
  const scale = h("div", { class: "ticks" }, ...ticks.map((tick) => h("span", {}, tick)));
  const named = Object.entries(notes).map(([name, note]) => h("span", { class: name }, note));
  return h("div", { class: "scale" }, h("span", {}, title), bar, scale, ...named);
}

/** The colour scale of speeds up to the set one, mm/s. */
export function legendOfSpeed(set: number): HTMLElement {
  return legend(scaleOf(SPEEDS, { title: t("scene.speed"), ticks: [0, set / 2, set].map(plain), notes: {} }));
}
