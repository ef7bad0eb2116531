import "./results.css";
import { h } from "../elements";
import type { Clock, CreatePanel, ProgramKind, Made, Selection, Translate } from "../data/types";
import { fixed, inWords, shown } from "../data/quantities";
import { longTable } from "./longtable";
import { facts, link, numeric, words } from "./tables";

interface Cut {
  end: "start" | "end";
  angle_deg: number | null;
  knife: 1 | 2;
  line?: number;
  shared: boolean;
  error_mm: number | null;
}

interface TapeRow {
  course: number;
  laid_mm: number | null;
  station_mm: number | null;
  waste_mm: number | null;
  waste_roll_mm: number | null;
  waste_formula_mm: number | null;
  waste_knives_mm: number | null;
  laying_stops: number;
  cuts: Cut[];
}

interface Place {
  pass: number;
  x_mm: number;
  y_mm: number;
  z_mm: number;
}

type Split = Place & { reason: "travel" | "crease" | null };
type Slowdown = Place & { axis: string; speed_mm_per_s: number };
type Cells = (Node | string)[];
type ListedNumber = keyof TapeRow & `${string}_mm`;

const LISTED: ListedNumber[] = [
  "laid_mm",
  "station_mm",
  "waste_mm",
  "waste_roll_mm",
  "waste_formula_mm",
  "waste_knives_mm",
];
const COATED = ["coverage_percent", "cv_percent", "cv_interior_percent"];

const number = (value: number | null, digits: number): string => (value === null ? "–" : fixed(value, digits));

function toCourse(course: number, clock: Clock, t: Translate, selection: Selection): HTMLElement {
  return link(String(course), t("place.go"), () => {
    selection.select(course);
    clock.seekCourse(course);
  });
}

function cutCells(row: TapeRow, end: Cut["end"], clock: Clock, t: Translate): Cells {
  const cut = row.cuts.find((found) => found.end === end);
  if (!cut) return [t("ledger.no_cut"), "", "", ""];
  const { line } = cut;
  return [
    `${cut.knife}${cut.shared ? ` ${t("ledger.shared")}` : ""}`,
    number(cut.angle_deg, 2),
    number(cut.error_mm, 4),
    line ? link(String(line), t("place.go"), () => clock.seekLine(line)) : "–",
  ];
}

function tapeTable(root: HTMLElement, rows: TapeRow[], clock: Clock, t: Translate, selection: Selection): HTMLElement {
  const cut = (end: string): ReturnType<typeof words>[] => [
    words(t(`ledger.${end}_knife`)),
    numeric(t("ledger.angle_deg")),
    numeric(t("ledger.cut_error_mm")),
    numeric(t("ledger.line")),
  ];
  const columns = [
    numeric(t("ledger.course")),
    ...LISTED.map((key) => numeric(t(`ledger.${key}`))),
    numeric(t("ledger.stops")),
    ...cut("start"),
    ...cut("end"),
  ];
  const cells = (row: TapeRow): Cells => [
    toCourse(row.course, clock, t, selection),
    ...LISTED.map((key) => number(row[key], 3)),
    String(row.laying_stops),
    ...cutCells(row, "start", clock, t),
    ...cutCells(row, "end", clock, t),
  ];
  // The sum of values that were not measured is not a number either.
  const sum = (key: ListedNumber): number => rows.reduce((total, row) => total + (row[key] ?? Number.NaN), 0);
  const totals = LISTED.map((key) => (key === "station_mm" ? "" : number(Number.isNaN(sum(key)) ? null : sum(key), 3)));
  const stops = rows.reduce((total, row) => total + row.laying_stops, 0);
  const foot = [t("ledger.total"), ...totals, String(stops), ...Array.from({ length: 8 }, () => "")];
  return longTable(root, t("ledger.tape"), columns, rows.length, (row) => cells(rows[row]!), [foot]);
}

function coatFacts(made: Made, t: Translate): HTMLElement {
  const { quantities, report } = made;
  const coated = quantities.filter(({ key }) => COATED.includes(key));
  const pairs: [string, string][] = coated.map((quantity) => [inWords(quantity.words), shown(report[quantity.key], quantity)]);
  for (const [key, value] of Object.entries((report["thickness"] ?? {}) as Record<string, number | null>)) {
    const relative = key.endsWith("_rel");
    const name = key.replace(/_(rel|um)$/, "");
    pairs.push([t(`coat.${name}`), value === null ? t("report.not_measured") : relative ? fixed(value, 3) : `${fixed(value, 1)} µm`]);
  }
  for (const { reason, area_m2 } of report["unreachable"] as { reason: string; area_m2: number }[]) {
    pairs.push([t(`coat.unreachable_${reason}`), `${fixed(area_m2, 4)} m²`]);
  }
  const mesh = report["mesh"] as { facets: number; mended: Record<string, number> };
  pairs.push([t("mesh.facets"), String(mesh.facets)]);
  for (const [what, count] of Object.entries(mesh.mended)) if (count) pairs.push([t(`mesh.${what}`), String(count)]);
  return facts(t("ledger.coat"), pairs);
}

/** The table of passes: when each is sprayed, and its lines in the program. */
function passesTable(root: HTMLElement, made: Made, clock: Clock, t: Translate, selection: Selection): HTMLElement {
  const { courses, lines } = made.blocks;
  const times = made.poses.column("time_s");
  const passes: [first: number, end: number][] = [];
  for (let row = 0; row < courses.length; ) {
    const first = row;
    const pass = courses[row]!;
    while (row < courses.length && courses[row] === pass) row++;
    if (pass) passes.push([first, row]);
  }
  const cells = (index: number): Cells => {
    const [first, end] = passes[index]!;
    const begin = times[Math.max(first - 1, 0)]!;
    const line = lines[first]!;
    const duration = fixed(times[end - 1]! - begin, 2);
    const place = line ? link(String(line), t("place.go"), () => clock.seekLine(line)) : "–";
    return [toCourse(courses[first]!, clock, t, selection), fixed(begin, 2), duration, place];
  };
  const columns = ["ledger.pass", "ledger.begin_s", "ledger.duration_s", "ledger.line"].map((key) => numeric(t(key)));
  return longTable(root, t("ledger.passes"), columns, passes.length, cells);
}

function placesTable<Found extends Place>(
  root: HTMLElement,
  caption: string,
  found: Found[],
  told: (place: Found) => string[],
  headings: string[],
  pass: (number: number) => HTMLElement,
  t: Translate,
): HTMLElement {
  const columns = [numeric(t("ledger.pass")), ...["x mm", "y mm", "z mm"].map(numeric), ...headings.map(words)];
  const cells = (row: number): Cells => {
    const place = found[row]!;
    const { x_mm, y_mm, z_mm } = place;
    return [pass(place.pass), ...[x_mm, y_mm, z_mm].map((value) => fixed(value, 1)), ...told(place)];
  };
  return longTable(root, caption, columns, found.length, cells);
}

function laid(root: HTMLElement, made: Made, clock: Clock, t: Translate, selection: Selection): HTMLElement[] {
  return [tapeTable(root, made.report["tape"] as TapeRow[], clock, t, selection)];
}

function sprayed(root: HTMLElement, made: Made, clock: Clock, t: Translate, selection: Selection): HTMLElement[] {
  const pass = (number: number): HTMLElement => toCourse(number, clock, t, selection);
  const nodes = [coatFacts(made, t), passesTable(root, made, clock, t, selection)];
  const splits = made.report["splits"] as Split[];
  const reason = (split: Split): string[] => [t(`ledger.split_${split.reason ?? "unplanned"}`)];
  if (splits.length) {
    nodes.push(placesTable(root, t("ledger.splits"), splits, reason, [t("ledger.reason")], pass, t));
  }
  const slow = made.report["slowdowns"] as Slowdown[];
  const speed = (place: Slowdown): string[] => [place.axis, fixed(place.speed_mm_per_s, 1)];
  const headings = [t("report.axis"), t("ledger.gun_speed")];
  if (slow.length) nodes.push(placesTable(root, t("ledger.slowdowns"), slow, speed, headings, pass, t));
  return nodes;
}

const LEDGERS: Record<ProgramKind, typeof sprayed> = { lay: laid, spray: sprayed };

/** Use of the tape, course by course; for spraying, the passes and the coat. */
export const createLedger: CreatePanel = (root, clock, t, selection) => {
  let made: Made | null = null;
  root.classList.add("results");
  root.dataset["testid"] = "ledger";

  function render(): void {
    if (!made) root.replaceChildren(h("p", { class: "empty" }, t("ledger.empty")));
    else root.replaceChildren(...LEDGERS[made.kind](root, made, clock, t, selection));
  }

  render();
  return {
    show(next) {
      made = next;
      render();
    },
    clear() {
      made = null;
      render();
    },
    retranslate: render,
  };
};
