import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { h } from "../elements";
import { t } from "../i18n";
import { lowerBound } from "../views/motion";
import { digitsOf, fixed, plain } from "../data/quantities";
import type { Limit } from "../data/types";
import { thinnedRows } from "./thinning";

// A limit this many times larger than the curve's largest value would flatten the curve, and is not drawn.
const FAR = 20;
// A press that moves farther than this counts as a drag.
const CLICK_PX = 3;

export interface Curve {
  name: string;
  /** Colour as a custom property of the page. */
  colour: string;
  values: Float32Array;
}

/** The data of one chart over time. */
export interface Chart {
  name: string;
  heading: string;
  unit: string;
  digits: number;
  times: Float32Array;
  /** Course of each row if lines break between courses. */
  courses: Float32Array | null;
  curves: Curve[];
  /** Whether a row's value holds for the whole motion that ends at the row. */
  stepped: boolean;
  limits: Limit[];
}

/** Start and end times of shaded spans, in seconds. */
export type Spans = [begin: number, end: number][];

export interface Around {
  spans: Spans;
  /** Visible time range in seconds. */
  range(): [low: number, high: number];
  /** Whether the limits are shown. */
  withLimits(): boolean;
  seek(time_s: number): void;
  zoom(low: number, high: number): void;
  reset(): void;
  now(): number;
  /** Shows one chart alone, or all of them again. */
  enlarge(name: string): void;
}

export const colour = (name: string): string => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

const decimals = (step: number): number => plain(step).split(".")[1]?.length ?? 0;

/** Axes in the page's colours and font. */
export function axes(): uPlot.Axis[] {
  const rem = parseFloat(getComputedStyle(document.documentElement).fontSize);
  const grid = { stroke: colour("--plot-grid"), width: 1 };
  const common = { stroke: colour("--dim"), font: `${0.6875 * rem}px system-ui, sans-serif`, grid, ticks: { ...grid, size: 4 } };
  const values = (_: uPlot, ticks: number[], _axis: number, _space: number, step: number): string[] =>
    ticks.map((tick) => (tick + 0).toFixed(decimals(step)));
  const widest = (ticks: string[] | null): number => Math.max(4, ...(ticks ?? []).map(({ length }) => length));
  return [
    { ...common, values, size: 1.4 * rem, gap: 2, space: 3.5 * rem },
    { ...common, values, size: (_, ticks) => (0.43 * widest(ticks) + 0.8) * rem, gap: 3, space: 1.4 * rem },
  ];
}

/** One chart of curves over time with their limits, the clock and the pointer. */
export class ChartView {
  readonly element: HTMLElement;
  private readonly plot: uPlot;
  private readonly now = h("div", { class: "plot-now" });
  private readonly told: HTMLElement[];
  private readonly beyond = h("small", { class: "plot-beyond" });
  private pointed: number | null = null;
  private y: [number, number] = [0, 1];

  constructor(
    private readonly chart: Chart,
    private readonly around: Around,
    alone: boolean,
  ) {
    const { curves, heading, name, unit } = chart;
    const about = t(alone ? "plots.all" : "plots.enlarge", { name: heading });
    const pressed = { "aria-pressed": String(alone), "aria-label": about, title: about };
    const press = (): void => around.enlarge(alone ? "" : name);
    const enlarge = h("button", { type: "button", class: "quiet", testid: `enlarge-${name}`, onclick: press, ...pressed }, alone ? "⤡" : "⤢");
    this.told = curves.map(() => h("output", {}));
    const names = curves.map((curve, index) => {
      const swatch = h("i", { class: "swatch", "aria-hidden": "true" });
      swatch.style.background = `var(${curve.colour})`;
      return h("span", {}, ...(curves.length > 1 ? [swatch] : []), `${curve.name} `, this.told[index]!);
    });
    const title = h("h3", {}, ...names, h("small", {}, unit), enlarge);
    const frame = h("div", { class: "plot-frame" });
    this.element = h("figure", { class: alone ? "plot wide" : "plot", testid: `plot-${name}`, role: "group", "aria-label": `${heading} ${unit}` }, title, frame);
    this.plot = new uPlot(this.options(), [[], ...curves.map(() => [])] as uPlot.AlignedData, frame);
    this.plot.over.append(this.beyond, this.now);
    this.listen();
  }

  /** Fits the chart to its container and draws it. */
  draw(): void {
    const frame = this.plot.root.parentElement!;
    this.plot.setSize({ width: frame.clientWidth, height: frame.clientHeight });
    this.plot.setData(this.thinned());
  }

  /** Moves the clock's line to the clock's time. */
  follow(): void {
    const [low, high] = this.around.range();
    const time = this.around.now();
    this.now.hidden = time < low || time > high;
    this.now.style.transform = `translateX(${this.plot.valToPos(time, "x")}px)`;
    this.tell();
  }

  destroy(): void {
    this.plot.destroy();
  }

  private options(): uPlot.Options {
    const { curves, stepped } = this.chart;
    const lines = curves.map((curve): uPlot.Series => {
      const line = { stroke: colour(curve.colour), width: 1.25, points: { show: false } };
      return stepped ? { ...line, paths: uPlot.paths.stepped!({ align: -1 }) } : line;
    });
    return {
      // The container has no size before it is on the page.
      width: 200,
      height: 100,
      legend: { show: false },
      padding: [6, 8, 0, 0],
      cursor: { y: false, points: { show: false }, sync: { key: "plots" }, drag: { x: true, y: false, setScale: false } },
      scales: {
        x: { time: false, range: () => this.around.range() },
        y: { range: () => this.y },
      },
      axes: axes(),
      series: [{}, ...lines],
      hooks: {
        drawClear: [(plot) => this.shade(plot)],
        // The position of a time in the chart is only known after drawing.
        draw: [(plot) => this.rule(plot), () => this.follow()],
        setSelect: [(plot) => this.selected(plot)],
        setCursor: [(plot) => this.point(plot)],
      },
    };
  }

  private listen(): void {
    const { over } = this.plot;
    let pressed = 0;
    over.addEventListener("mousedown", (event) => (pressed = event.clientX));
    over.addEventListener("click", (event) => {
      if (Math.abs(event.clientX - pressed) > CLICK_PX) return;
      this.around.seek(this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x"));
    });
    over.addEventListener("dblclick", () => this.around.reset());
  }

  private selected(plot: uPlot): void {
    const { left, width } = plot.select;
    if (width <= CLICK_PX) return;
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.around.zoom(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
  }

  private point(plot: uPlot): void {
    const { left } = plot.cursor;
    this.pointed = left === undefined || left < 0 ? null : plot.posToVal(left, "x");
    this.tell();
  }

  /** Shows the values under the pointer, or else at the clock's time. */
  private tell(): void {
    const time = this.pointed ?? this.around.now();
    const { curves, digits } = this.chart;
    curves.forEach(({ values }, index) => {
      const value = this.valueAt(values, time);
      this.told[index]!.textContent = Number.isNaN(value) ? "–" : fixed(value, digitsOf(value, digits));
    });
  }

  private valueAt(curve: Float32Array, time: number): number {
    const { courses, stepped, times } = this.chart;
    const row = Math.min(lowerBound(times, time), times.length - 1);
    const [begin, end] = [times[row - 1] ?? times[row]!, times[row]!];
    if (courses && row > 0 && begin < time && courses[row - 1] !== courses[row]) return Number.NaN;
    if (stepped || row <= 0 || !(end > begin)) return curve[row] ?? Number.NaN;
    const share = Math.min(Math.max((time - begin) / (end - begin), 0), 1);
    return curve[row - 1]! + share * (curve[row]! - curve[row - 1]!);
  }

  private thinned(): uPlot.AlignedData {
    const { courses, curves, times } = this.chart;
    const [low, high] = this.around.range();
    const lines = curves.map(({ values }) => values);
    const rows = thinnedRows(times, lines, low, high, Math.max(Math.round(this.plot.bbox.width), 50));
    const xs: number[] = [];
    const ys: (number | null)[][] = curves.map(() => []);
    let [least, greatest] = [Infinity, -Infinity];
    rows.forEach((row, index) => {
      const before = rows[index - 1];
      if (courses && before !== undefined && courses[before] !== courses[row]) {
        // Nothing is measured between courses.
        xs.push(times[row]!);
        for (const line of ys) line.push(null);
      }
      xs.push(times[row]!);
      lines.forEach((line, curve) => {
        const value = line[row]!;
        ys[curve]!.push(Number.isFinite(value) ? value : null);
        if (!Number.isFinite(value)) return;
        least = Math.min(least, value);
        greatest = Math.max(greatest, value);
      });
    });
    this.y = padded(...this.reached(least, greatest));
    return [xs, ...ys];
  }

  /** Range of the curves and their limits; names the limits that are too far away to be drawn. */
  private reached(least: number, greatest: number): [number, number] {
    const values = this.around.withLimits() ? this.chart.limits.map(({ value }) => value) : [];
    const size = Math.max(Math.abs(least), Math.abs(greatest));
    const far = values.filter((value) => size > 0 && Math.abs(value) > FAR * size);
    const near = values.filter((value) => !far.includes(value));
    const first = far.at(0);
    const limit = first === undefined ? "" : far.includes(-first) ? `±${plain(Math.abs(first))}` : far.map(plain).join(", ");
    this.beyond.textContent = limit && t("plots.beyond", { limit });
    return [Math.min(least, ...near), Math.max(greatest, ...near)];
  }

  private shade(plot: uPlot): void {
    const { ctx, bbox } = plot;
    const [low, high] = this.around.range();
    ctx.save();
    ctx.fillStyle = colour("--plot-grid");
    ctx.globalAlpha = 0.6;
    for (const [begin, end] of this.around.spans) {
      if (end < low || begin > high) continue;
      const left = plot.valToPos(Math.max(begin, low), "x", true);
      const right = plot.valToPos(Math.min(end, high), "x", true);
      // Many that are thinner than a pixel shade it by their share of it.
      ctx.fillRect(left, bbox.top, right - left, bbox.height);
    }
    ctx.restore();
  }

  private rule(plot: uPlot): void {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([5 * devicePixelRatio, 3 * devicePixelRatio]);
    for (const { judged, value } of this.chart.limits) {
      const y = Math.round(plot.valToPos(value, "y", true));
      if (y < bbox.top || y > bbox.top + bbox.height) continue;
      ctx.strokeStyle = colour(judged ? "--plot-limit" : "--dim");
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
    ctx.restore();
  }
}

/** A range with a margin at both ends, even if it has no width. */
function padded(least: number, greatest: number): [number, number] {
  if (!(least <= greatest)) return [0, 1];
  const room = greatest > least ? 0.06 * (greatest - least) : Math.max(Math.abs(least) * 1e-3, 1e-3);
  return [least - room, greatest + room];
}
