import "./results.css";
import uPlot from "uplot";
import { ChartView, axes, colour, type Around, type Chart, type Curve, type Spans } from "./chart";
import { h } from "../elements";
import type { Clock, CreatePanel, Made, Panel, Selection, Table, Translate } from "../data/types";
import { FIRST, KINDS } from "../data/kinds";
import { stemOf } from "../data/quantities";

const VIEWS = ["positions", "speeds", "errors", "thickness"] as const;
type View = (typeof VIEWS)[number];

// Curves that share a chart.
const TOGETHER: Record<string, string[]> = { normal_error_mm: ["normal_error_mm", "lateral_error_mm"] };
// Normal and lateral error are judged together by the position limit.
const LIMIT_OF: Record<string, string> = { normal_error_mm: "position_error_mm" };
// What tells where and how fast a value was measured.
const PLACES = ["time_s", "course", "pass", "arc_length_mm", "speed_mm_per_s", "beside_crease"];
const UNSIGNED = ["position_error_mm", "surface_distance_mm", "deviation_deg"];
const BINS = 48;

/** Positions of the axes against their travel, or speeds against their limits. */
function axisCharts(made: Made, table: Table, times: Float32Array, view: "positions" | "speeds"): Chart[] {
  const columns = table.columns.filter((column) => column !== "time_s");
  return columns.map((column) => {
    const { stem, unit } = stemOf(column);
    const axis = made.report.axes[stem]!;
    const limits = view === "positions" ? [axis.lower!, axis.upper!] : [-axis.speed_limit!, axis.speed_limit!];
    return {
      name: stem,
      heading: stem,
      unit,
      digits: view === "positions" ? 3 : 1,
      times,
      courses: null,
      curves: [{ name: stem, colour: "--plot-1", values: table.column(column) }],
      stepped: view === "speeds",
      limits: limits.map((value) => ({ value, judged: true })),
    };
  });
}

/** Rows of a table whose time is a number; others cannot be plotted over time. */
function timed(table: Table): (column: string) => Float32Array {
  const times = table.column("time_s");
  const rows = Array.from(times.keys()).filter((row) => Number.isFinite(times[row]!));
  return (column) => {
    const values = table.column(column);
    return rows.length === table.rows ? values : Float32Array.from(rows, (row) => values[row]!);
  };
}

/** Charts of the deviations that count, and of those beside creases, which do not. */
function besideCreases(values: Float32Array, beside: Float32Array, t: Translate): Omit<Curve, "colour">[] {
  const where = (free: boolean): Float32Array => values.map((value, row) => (beside[row]! > 0 === free ? value : Number.NaN));
  const counted = { name: t("plots.deviation_deg"), values: where(false) };
  return beside.some(Boolean) ? [counted, { name: t("plots.beside_crease"), values: where(true) }] : [counted];
}

function errorCharts(made: Made, table: Table, t: Translate): Chart[] {
  const column = timed(table);
  const joined = Object.values(TOGETHER).flatMap((names) => names.slice(1));
  const shown = table.columns.filter((name) => !PLACES.includes(name) && !joined.includes(name));
  return shown.map((name) => {
    const names = (TOGETHER[name] ?? [name]).filter((each) => table.columns.includes(each));
    const drawn = names.map((each) => ({ name: t(`plots.${each}`), values: column(each) }));
    if (name === "deviation_deg") drawn.splice(0, 1, ...besideCreases(column(name), column("beside_crease"), t));
    const curves = drawn.map((curve, index): Curve => ({ ...curve, colour: `--plot-${index + 1}` }));
    const limit = made.limits[`max_${LIMIT_OF[name] ?? name}`];
    const both = limit ? [limit, ...(UNSIGNED.includes(name) ? [] : [{ ...limit, value: -limit.value }])] : [];
    return {
      name,
      heading: names.map((each) => t(`plots.${each}`)).join(", "),
      unit: stemOf(name).unit,
      digits: 4,
      times: column("time_s"),
      courses: column(table.columns.includes("pass") ? "pass" : "course"),
      curves,
      stepped: false,
      limits: both,
    };
  });
}

/** Spans of rapid motion; adjacent ones are merged. */
function rapids(made: Made): Spans {
  const rapid = made.blocks.kind_names.indexOf("rapid");
  const times = made.poses.column("time_s");
  const spans: Spans = [];
  made.blocks.kinds.forEach((kind, row) => {
    if (kind !== rapid || row === 0) return;
    const last = spans.at(-1);
    if (last && last[1] === times[row - 1]) last[1] = times[row]!;
    else spans.push([times[row - 1]!, times[row]!]);
  });
  return spans;
}

/** Histogram of the final thickness over the surface. */
function histogram(root: HTMLElement, coat: Table, t: Translate): uPlot {
  const values = coat.column(coat.columns.at(-1)!).filter(Number.isFinite);
  const least = values.reduce((low, value) => Math.min(low, value), Infinity);
  const greatest = values.reduce((high, value) => Math.max(high, value), -Infinity);
  const step = (greatest - least) / BINS || 1;
  const counts = new Array<number>(BINS).fill(0);
  for (const value of values) counts[Math.min(Math.floor((value - least) / step), BINS - 1)]! += 100 / values.length;
  const centres = counts.map((_, bin) => least + (bin + 0.5) * step);
  const unit = coat.unit === "um" ? "µm" : t("plots.relative");
  const frame = h("div", { class: "plot-frame" });
  const heading = h("h3", {}, t("plots.histogram", { unit }));
  root.replaceChildren(h("figure", { class: "plot wide", testid: "plot-thickness" }, heading, frame));
  const bars: uPlot.Series = {
    stroke: colour("--plot-1"),
    fill: colour("--plot-1"),
    points: { show: false },
    paths: uPlot.paths.bars!({ size: [0.9] }),
  };
  const options: uPlot.Options = {
    width: frame.clientWidth,
    height: frame.clientHeight,
    legend: { show: false },
    cursor: { show: false },
    padding: [6, 8, 0, 0],
    scales: { x: { time: false, range: () => [least - step, greatest + step] }, y: { range: (_, __, most) => [0, 1.05 * most] } },
    axes: axes(),
    series: [{}, bars],
  };
  return new uPlot(options, [centres, counts], frame);
}

class Plots implements Panel {
  private made: Made | null = null;
  private view: View = "positions";
  private charts: ChartView[] = [];
  private bars: uPlot | null = null;
  private spans: Spans = [];
  private range: [number, number] = [0, 1];
  private opened = 0;
  private frame = 0;
  private stale = false;
  // The chart that is shown alone, by its name.
  private alone = "";
  private readonly bar = h("div", { class: "plots-bar" });
  private readonly body = h("div", { class: "plots-body", tabindex: 0 });
  private readonly limits = h("input", { type: "checkbox", testid: "plots-limits", checked: true });

  constructor(
    root: HTMLElement,
    private readonly clock: Clock,
    private readonly t: Translate,
    private readonly selection: Selection,
  ) {
    root.classList.add("plots-panel");
    root.dataset["testid"] = "plots";
    root.append(this.bar, this.body);
    this.limits.addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.resized()).observe(this.body);
    clock.onChange(() => this.ask());
    selection.onChange(() => this.renderBar());
    this.retranslate();
  }

  show(made: Made): void {
    this.made = made;
    this.spans = rapids(made);
    if (!KINDS[made.kind].coat && this.view === "thickness") this.view = "positions";
    this.range = this.whole();
    this.retranslate();
  }

  clear(): void {
    this.made = null;
    this.retranslate();
  }

  retranslate(): void {
    this.renderBar();
    this.stale = true;
    this.resized();
  }

  retheme(): void {
    this.stale = true;
    this.resized();
  }

  private whole(): [number, number] {
    const { duration } = this.clock;
    return [0, duration > 0 ? duration : 1];
  }

  private renderBar(): void {
    const { made, t } = this;
    const views = VIEWS.filter((view) => view !== "thickness" || (made && KINDS[made.kind].coat));
    const buttons = views.map((view) => {
      const pressed = String(view === this.view);
      const choose = (): void => this.choose(view);
      return h(
        "button",
        { type: "button", class: "choice", testid: `plots-${view}`, "aria-pressed": pressed, onclick: choose },
        t(`plots.${view}`),
      );
    });
    const { course } = this.selection;
    const name = t(`place.${KINDS[made?.kind ?? FIRST].part}`, { course });
    const zoom = course
      ? [h("button", { type: "button", testid: "plots-course", onclick: () => this.zoomToCourse(course) }, t("plots.zoom_to", { name }))]
      : [];
    const whole = h("button", { type: "button", testid: "plots-whole", onclick: () => this.zoom(...this.whole()) }, t("plots.whole"));
    const limits = h("label", {}, this.limits, ` ${t("plots.with_limits")}`);
    const note = h("span", { class: "note" }, t("plots.note"));
    const overTime = this.view === "thickness" ? [] : [...zoom, whole, limits, note];
    this.bar.replaceChildren(h("div", { role: "group", "aria-label": t("plots.choose") }, ...buttons), ...overTime);
  }

  private choose(view: View): void {
    this.view = view;
    this.renderBar();
    this.bar.querySelector<HTMLElement>(`[data-testid="plots-${view}"]`)!.focus();
    this.stale = true;
    this.resized();
  }

  private zoomToCourse(course: number): void {
    const { blocks, poses } = this.made!;
    const first = blocks.courses.indexOf(course);
    if (first < 0) return;
    const last = blocks.courses.lastIndexOf(course);
    this.zoom(poses.at(Math.max(first - 1, 0), "time_s"), poses.at(last, "time_s"));
  }

  private zoom(low: number, high: number): void {
    if (!(high > low)) return;
    this.range = [low, high];
    this.draw();
  }

  private draw(): void {
    for (const chart of this.charts) chart.draw();
  }

  /** Builds charts when they become visible, and refits them when their container is resized. */
  private resized(): void {
    if (!this.body.clientWidth) return;
    if (this.stale) void this.open();
    else {
      this.draw();
      const frame = this.bars?.root.parentElement;
      if (frame) this.bars!.setSize({ width: frame.clientWidth, height: frame.clientHeight });
    }
  }

  private async open(): Promise<void> {
    const { made, t, view } = this;
    this.stale = false;
    const opened = ++this.opened;
    this.close();
    this.body.replaceChildren(h("p", { class: "empty" }, t(made ? "plots.loading" : "plots.empty")));
    if (!made) return;
    try {
      if (view === "thickness") {
        const coat = await made.table("coat");
        if (opened !== this.opened) return;
        if (coat) this.bars = histogram(this.body, coat, t);
        else this.body.replaceChildren(h("p", { class: "empty" }, t("plots.no_coat")));
        return;
      }
      const charts = await this.chartsOf(made, view);
      if (opened === this.opened) this.build(charts);
    } catch (error) {
      if (opened === this.opened) this.body.replaceChildren(h("p", { class: "empty" }, String((error as Error).message)));
    }
  }

  private async chartsOf(made: Made, view: Exclude<View, "thickness">): Promise<Chart[]> {
    const table = view === "positions" ? made.poses : await made.table(view);
    if (!table?.rows) return [];
    if (view === "errors") return errorCharts(made, table, this.t);
    return axisCharts(made, table, made.poses.column("time_s"), view);
  }

  private build(charts: Chart[]): void {
    if (!charts.length) {
      this.body.replaceChildren(h("p", { class: "empty" }, this.t("plots.nothing")));
      return;
    }
    const around: Around = {
      spans: this.spans,
      range: () => this.range,
      withLimits: () => this.limits.checked,
      seek: (time_s) => this.clock.seekTime(time_s),
      zoom: (low, high) => this.zoom(low, high),
      reset: () => this.zoom(...this.whole()),
      now: () => this.clock.time,
      enlarge: (name) => void this.enlarge(name),
    };
    const alone = charts.filter(({ name }) => name === this.alone);
    this.charts = (alone.length ? alone : charts).map((chart) => new ChartView(chart, around, alone.length > 0));
    const elements = this.charts.map(({ element }) => element);
    this.body.replaceChildren(...(alone.length ? elements : [h("div", { class: "plots-grid" }, ...elements)]));
    this.draw();
  }

  /** Shows one chart alone, or all of them again; the focus stays on the chart's button. */
  private async enlarge(name: string): Promise<void> {
    const button = `enlarge-${name || this.alone}`;
    this.alone = name;
    await this.open();
    this.body.querySelector<HTMLElement>(`[data-testid="${button}"]`)?.focus();
  }

  private close(): void {
    for (const chart of this.charts) chart.destroy();
    this.charts = [];
    this.bars?.destroy();
    this.bars = null;
  }

  private ask(): void {
    if (this.frame || !this.charts.length || !this.body.clientWidth) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = 0;
      for (const chart of this.charts) chart.follow();
    });
  }
}

/** Positions, speeds and errors over time, with their limits and the clock. */
export const createPlots: CreatePanel = (root, clock, t, selection) => new Plots(root, clock, t, selection);
