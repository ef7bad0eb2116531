import "./results.css";
import { h } from "../elements";
import type { AxisReport, Clock, CreatePanel, Failure, Judged, Limit, Made, Planned, Quantity, Selection, Translate } from "../data/types";
import { createPlyChange, plyFacts, plyFailures } from "./ply";
import { failureName, failureValue, fixed, inWords, limitValue, percent, plain, shown } from "../data/quantities";
import { bar, facts, link, numeric, table, words } from "./tables";

// Failures listed in the table; the rest are only counted.
const SHOWN_FAILURES = 500;

/** Whether a value keeps a limit. */
const kept = (value: number, { value: bound, least }: Limit): boolean => (least ? value >= bound : value <= bound);

/** Quantities beyond a limit that the setup does not judge. */
function beyondUnjudged({ limits, quantities, report }: Judged): Quantity[] {
  return quantities.filter(({ key }) => {
    const limit = limits[key];
    return limit && !limit.judged && !kept(Number(report[key]), limit);
  });
}

/** Course or pass of a failure, 0 where none applies. */
const courseOf = (failure: Failure): number => Number(failure.course ?? failure["pass"] ?? 0);

/** Time at which a quantity is worst in a course or pass; NaN if it was not measured along it. */
async function worst(made: Made, what: string, course: number): Promise<number> {
  const table = await made.table("errors");
  if (!table || table.index(what) < 0) return Number.NaN;
  const courses = table.column(table.index("pass") < 0 ? "course" : "pass");
  // A value that could not be measured counts as worse than any number.
  const sizes = table.column(what).map((value) => (Number.isNaN(value) ? Infinity : Math.abs(value)));
  let found = -1;
  courses.forEach((each, row) => {
    if (each === course && (found < 0 || sizes[row]! > sizes[found]!)) found = row;
  });
  return found < 0 ? Number.NaN : table.at(found, "time_s");
}

/** Moves the clock to a failure: to its line, else to its worst moment, else to its course. */
async function goTo(made: Made, failure: Failure, clock: Clock, selection: Selection): Promise<void> {
  const course = courseOf(failure);
  if (course) selection.select(course);
  if (failure.line) {
    clock.seekLine(failure.line);
    return;
  }
  clock.seekCourse(course);
  const { row } = clock;
  const time = await worst(made, failure.what, course);
  // If the user has moved the clock meanwhile, leave it.
  if (Number.isFinite(time) && clock.row === row) clock.seekTime(time);
}

/** Button that goes to a failure; a dash if it has no place in the program. */
function place(made: Made, failure: Failure, clock: Clock, t: Translate, selection: Selection): Node | string {
  const { line, point } = failure;
  const course = courseOf(failure);
  if (!line && !course) return "–";
  const parts = line ? [t("place.line", { line })] : [];
  if (course) parts.push(t("pass" in failure ? "place.pass" : "place.course", { course }));
  if (course && point) parts.push(t("place.point", { point }));
  return link(parts.join(", "), t("place.go"), () => void goTo(made, failure, clock, selection));
}

/** The table of failures, with buttons that go to them. */
function failuresTable(made: Made, clock: Clock, t: Translate, selection: Selection): HTMLElement {
  const { failures } = made.report;
  const rows = failures
    .slice(0, SHOWN_FAILURES)
    .map((failure) => [
      place(made, failure, clock, t, selection),
      failureName(failure, made, t),
      failureValue(failure, t),
      failure.limit === null ? "–" : limitValue(failure.limit, failure.what),
    ]);
  const values = [numeric(t("report.found")), numeric(t("report.limit"))];
  const columns = [words(t("report.place")), words(t("report.what")), ...values];
  const section = h("section", { class: "failures" }, table(t("report.failures", { count: failures.length }), columns, rows));
  const more = failures.length - rows.length;
  if (more > 0) section.append(h("p", { class: "note" }, t("report.more", { count: more })));
  return section;
}

/** The verdict in one line for the page header. */
export const createBadge: CreatePanel = (root, _clock, t) => {
  let made: Judged | null = null;
  let changes: string[] = [];
  const badge = h("div", { class: "badge", role: "status", testid: "verdict" });
  root.append(badge);

  function render(): void {
    badge.hidden = !made;
    if (!made) return;
    const { report, quantities, notJudged } = made;
    const unjudged = beyondUnjudged(made);
    badge.dataset["verdict"] = report.passed ? (unjudged.length ? "unjudged" : "passed") : "failed";
    const word = report.passed ? t("verdict.passed") : t("verdict.failed", { count: report.failures.length });
    const left = notJudged.map(inWords).join(", ");
    const silent = left ? [h("b", { class: "free", testid: "not-judged" }, t("verdict.not_judged", { what: left }))] : [];
    const numbers = quantities
      .filter(({ headline }) => headline)
      .map((quantity) => h("span", {}, `${inWords(quantity.words)} `, h("b", {}, shown(report[quantity.key], quantity))));
    const what = unjudged.map(({ words }) => inWords(words)).join(", ");
    const free = what ? [h("b", { class: "free" }, t("verdict.unjudged", { what }))] : [];
    if (changes.length) {
      badge.dataset["verdict"] = "stale";
      const what = h("b", { class: "free" }, t("verdict.stale.changed", { what: changes.join(", ") }));
      badge.replaceChildren(h("strong", {}, t("verdict.stale")), what, h("span", {}, t("verdict.stale.was", { word, name: made.job.name })));
    } else {
      badge.replaceChildren(h("strong", {}, word), ...free, ...silent, ...numbers);
    }
    badge.title = [...badge.children].map(({ textContent }) => textContent).join(" · ");
  }

  const show = (next: Judged | null): void => {
    made = next;
    render();
  };

  render();
  return {
    show,
    plan: show,
    clear: () => show(null),
    retranslate: render,
    outdated(next) {
      changes = next;
      render();
    },
  };
};

function quantitiesTable({ limits, quantities, report }: Judged, t: Translate): HTMLElement {
  const errors = quantities.filter(({ group }) => group === "error");
  const rows = errors.map((quantity) => {
    const value = report[quantity.key];
    const limit = limits[quantity.key];
    const row: (Node | string)[] = [
      h("span", { title: inWords(quantity.about) }, inWords(quantity.words)),
      shown(value, quantity),
    ];
    if (!limit) return [...row, "", "", ""];
    const measured = typeof value === "number";
    const share = measured ? `${fixed((100 * value) / limit.value, 0)} %` : "";
    const beyond = measured && kept(value, limit) ? "" : limit.judged ? "beyond" : "unjudged";
    return [
      ...row,
      `${limit.least ? "≥ " : ""}${plain(limit.value)} ${quantity.unit}`.trimEnd(),
      limit.judged ? share : `${share} ${t("report.not_judged")}`,
      bar(0, measured ? value : limit.value, 0, limit.value, beyond),
    ];
  });
  const headings = [words(t("report.quantity")), numeric(t("report.found")), numeric(t("report.limit"))];
  return table(t("report.largest"), [...headings, numeric(t("report.share")), words("")], rows);
}

function axesTable(made: Made, t: Translate): HTMLElement {
  // A speed may exceed its limit by the last digit of a feed word, so only verification decides what is red.
  const failed = new Set(made.report.failures.map(({ what }) => what));
  const number = (value: number | null): string => (value === null ? "–" : fixed(value, 2));
  const drawn = (begin: number | null, end: number | null, low: number, high: number, what: string): Node | string =>
    begin === null || end === null ? "" : bar(begin, end, low, high, failed.has(what) ? "beyond" : "");
  const row = ([name, axis]: [string, AxisReport]): (Node | string)[] => {
    const { unit, min, max, max_speed: top } = axis;
    const [lower, upper, limit] = [axis.lower!, axis.upper!, axis.speed_limit!];
    return [
      h("b", {}, name),
      unit,
      number(min),
      number(max),
      `${plain(lower)} … ${plain(upper)}`,
      drawn(min, max, lower, upper, `axis_${name}_${unit}`),
      number(top),
      plain(limit),
      drawn(0, top, 0, limit, `axis_${name}_speed_${unit}_per_s`),
    ];
  };
  const columns = [
    words(t("report.axis")),
    words(t("report.unit")),
    numeric(t("report.least")),
    numeric(t("report.greatest")),
    numeric(t("report.travel")),
    words(""),
    numeric(t("report.top_speed")),
    numeric(t("report.limit")),
    words(""),
  ];
  return table(t("report.axes"), columns, Object.entries(made.report.axes).map(row));
}

function factsList(made: Made, t: Translate): HTMLElement {
  const { report, quantities } = made;
  const counted = quantities.filter(({ group }) => group === "fact");
  const pairs: [string, Node | string][] = counted.map((quantity) => [
    inWords(quantity.words),
    shown(report[quantity.key], quantity),
  ]);
  for (const [share, value] of Object.entries((report["time_shares"] ?? {}) as Record<string, number | null>)) {
    pairs.push([t(`time.${share}`), percent(value, t)]);
  }
  pairs.push(
    [t("report.controller"), String(made.setup["output"]?.["controller"])],
    ["tapelayer", String(report["version"])],
    [t("report.sha256"), h("code", { testid: "program-sha256" }, report.program_sha256)],
  );
  return facts(t("report.program"), pairs);
}

/** Results of verification: failures, quantities against their limits, axes, facts about the program. */
export const createVerdict: CreatePanel = (root, clock, t, selection) => {
  let made: Made | null = null;
  let planned: Planned | null = null;
  const change = createPlyChange();
  root.classList.add("results");
  // It scrolls and contains nothing focusable, so it takes the focus itself.
  root.tabIndex = 0;

  function render(): void {
    if (planned) {
      const failures = planned.report.passed ? [] : [plyFailures(planned, t, selection)];
      root.replaceChildren(...failures, quantitiesTable(planned, t), change.root, ...plyFacts(planned, t));
    } else if (made) {
      root.replaceChildren(quantitiesTable(made, t), axesTable(made, t), factsList(made, t));
      if (made.report.passed) return;
      const failures = failuresTable(made, clock, t, selection);
      failures.dataset["testid"] = "failures";
      root.prepend(failures);
    } else root.replaceChildren(h("p", { class: "empty" }, t("verdict.empty")));
  }

  const show = (next: Made | null): void => {
    made = next;
    planned = null;
    render();
  };

  render();
  return {
    show,
    plan(next, former) {
      made = null;
      planned = next;
      // Without the former one there is nothing to compare with.
      change.show(next, former).catch(() => (change.root.hidden = true));
      render();
    },
    clear: () => show(null),
    retranslate() {
      render();
      change.retranslate();
    },
  };
};
