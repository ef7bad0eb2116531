import { compareJobs } from "../data/api";
import { inWords, shown } from "../data/quantities";
import type { Failure, Planned, Selection, Translate } from "../data/types";
import { h } from "../elements";
import { createComparison } from "./comparing";
import { inLanguage } from "./sentences";
import { facts, link, table, words } from "./tables";

// Failures listed in the table; the rest are only counted.
const SHOWN_FAILURES = 500;

/** A limit that a plan does not keep, where on the mould, and what to do. */
interface PlyFailure extends Failure {
  courses?: number[];
  place_mm?: [number, number, number] | null;
  sentence?: string;
}

/** Chooses the first course of a failure, and looks at its place. */
function goTo({ courses, place_mm: place }: PlyFailure, selection: Selection): void {
  if (courses?.length) selection.select(courses[0]!);
  if (place) selection.visit(place);
}

/** The failures of a plan, with buttons that go to them on the mould. */
export function plyFailures({ report }: Planned, t: Translate, selection: Selection): HTMLElement {
  const failures = report.failures as PlyFailure[];
  const rows = failures.slice(0, SHOWN_FAILURES).map((failure) => {
    const { courses = [], place_mm: place } = failure;
    const name = courses.length ? t(courses.length > 1 ? "plan.courses" : "plan.course", { course: courses.join(", ") }) : t("plan.place");
    const where = place || courses.length ? link(name, t("plan.go"), () => goTo(failure, selection)) : "–";
    return [where, inLanguage(failure, failure.sentence ?? failure.what)];
  });
  const columns = [words(t("report.place")), words(t("report.what"))];
  const section = h("section", { class: "failures", testid: "failures" }, table(t("report.failures", { count: failures.length }), columns, rows));
  const more = failures.length - rows.length;
  if (more > 0) section.append(h("p", { class: "note" }, t("report.more", { count: more })));
  return section;
}

/** What a plan is: its quantities without a limit, and what the planner remarks on. */
export function plyFacts({ report, quantities }: Planned, t: Translate): HTMLElement[] {
  const counted = quantities.filter(({ group }) => group === "fact");
  const pairs = counted.map((quantity): [string, string] => [inWords(quantity.words), shown(report[quantity.key], quantity)]);
  const found = [facts(t("plan.facts"), [...pairs, ["tapelayer", String(report["version"])]])];
  const remarks = report["remarks"];
  if (Array.isArray(remarks) && remarks.length) {
    const rows = remarks.map((remark) => h("li", {}, String(remark)));
    found.push(h("section", { class: "remarks", testid: "remarks" }, h("h3", {}, t("plan.remarks")), h("ul", {}, ...rows)));
  }
  return found;
}

/** How a plan differs from the one before it. */
export function createPlyChange(): { root: HTMLElement; show(planned: Planned, former: Planned | null): Promise<void>; retranslate(): void } {
  const comparison = createComparison("plan.change");
  comparison.root.dataset["testid"] = "plan-change";
  return {
    root: comparison.root,
    async show(planned, former) {
      comparison.root.hidden = true;
      if (former) comparison.show(former.job, planned.job, await compareJobs(former.job.id, planned.job.id));
    },
    retranslate: comparison.retranslate,
  };
}
