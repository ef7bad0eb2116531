import { compareJobs, deleteJob, jobs, noteJob, restoreJob, underWay } from "../data/api";
import { lasting } from "../data/quantities";
import { h } from "../elements";
import { problemTitle, t } from "../i18n";
import type { Job } from "../data/types";
import { ask } from "./asking";
import { createComparison } from "./comparing";

export interface JobList {
  refresh(): void;
  current(id: string): void;
  retranslate(): void;
}

const COLUMNS = ["compare", "name", "kind", "state", "duration", "blocks", "input", "note", "error", "created"] as const;
const HASH_DIGITS = 8;
const MOST_NOTE = 2000;
const AGAIN_MS = 3000;

function local(moment: string): string {
  const date = new Date(moment);
  const two = (value: number): string => String(value).padStart(2, "0");
  const day = `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())}`;
  return `${day} ${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}`;
}

/** Text key of a job's state. */
export function stateKey({ state, error }: Job): string {
  return error?.code === "verification-failed" ? "state.judged-bad" : `state.${state}`;
}

/** A job's state, and its place where it waits. */
export function stateText(job: Job): string {
  return job.place === null ? t(stateKey(job)) : t("state.place", { state: t(stateKey(job)), place: job.place });
}

/** What a job is called: by its owner, else as its file. */
export const titleOf = ({ title, name }: Job): string => title || name;

/** The user's own jobs: open one, note something on it, compare two, delete one and bring it back. */
export function createJobList(root: HTMLElement, open: (id: string) => void, removed: (id: string) => void, failed: (error: unknown) => void): JobList {
  const body = h("tbody");
  const heads = COLUMNS.map((name) => h("th", { t: `jobs.${name}`, scope: "col" }));
  const table = h("table", { testid: "jobs", class: "jobs", tLabel: "tab.jobs" }, h("thead", {}, h("tr", {}, ...heads, h("td"))), body);
  const empty = h("p", { class: "about", t: "jobs.none" });
  const undo = h("p", { class: "undo", testid: "undo", role: "status" });
  const comparison = createComparison();
  const comparing = h("button", { type: "button", testid: "jobs-compare", t: "jobs.compare.show", onclick: () => void compare().catch(failed) });
  root.append(undo, table, empty, h("p", {}, comparing), comparison.root);
  let found: Job[] = [];
  // Ids of the jobs to compare, the one ticked first in front.
  let ticked: string[] = [];
  let deleted: { job: Job; opened: boolean } | null = null;
  let opened = "";
  let timer = 0;

  const compare = async (): Promise<void> => {
    const pair = ticked.map((id) => found.find((job) => job.id === id)!);
    comparison.show(pair[0]!, pair[1]!, await compareJobs(pair[0]!.id, pair[1]!.id));
  };

  const tick = (id: string, on: boolean): void => {
    ticked = [...ticked.filter((each) => each !== id), ...(on ? [id] : [])].slice(-2);
    for (const box of body.querySelectorAll<HTMLInputElement>("[data-testid=job-tick]")) box.checked = ticked.includes(box.value);
    comparing.disabled = ticked.length < 2;
  };

  const remove = async (job: Job): Promise<void> => {
    const choices = { delete: t("jobs.ask.delete"), keep: t("jobs.ask.keep") };
    if (underWay(job) && (await ask("jobs.ask", t("jobs.ask.about", { name: titleOf(job) }), choices)) !== "delete") return;
    await deleteJob(job.id);
    deleted = { job, opened: job.id === opened };
    removed(job.id);
    refresh();
  };

  const restore = async ({ job, opened: wasOpened }: { job: Job; opened: boolean }): Promise<void> => {
    await restoreJob(job.id);
    deleted = null;
    refresh();
    if (wasOpened) open(job.id);
  };

  const noteOf = (job: Job): HTMLElement => {
    const field = h("input", { testid: "job-note", maxlength: MOST_NOTE, value: job.note, tLabel: "jobs.note", tPlaceholder: "jobs.note.none" });
    field.addEventListener("change", () => {
      job.note = field.value;
      noteJob(job.id, field.value).catch(failed);
    });
    // What was told while somebody wrote is drawn afterwards.
    field.addEventListener("blur", () => setTimeout(draw));
    return field;
  };

  const errorOf = ({ error }: Job): HTMLElement =>
    error ? h("span", { class: "sentence", title: error.detail }, `${problemTitle(error)}: ${error.detail}`) : h("span");

  const row = (job: Job): HTMLElement => {
    const label = t("jobs.compare.this", { name: titleOf(job) });
    const box = h("input", { type: "checkbox", testid: "job-tick", value: job.id, "aria-label": label, disabled: !job.summary });
    box.checked = ticked.includes(job.id);
    box.addEventListener("change", () => tick(job.id, box.checked));
    const link = h("a", { href: `#job=${job.id}`, title: `${job.name} · ${job.id}`, onclick: () => open(job.id) }, titleOf(job));
    const removing = h("button", { type: "button", class: "quiet", testid: "job-delete", t: "jobs.delete", onclick: () => void remove(job).catch(failed) });
    const input = h("code", { title: job.source_sha256 }, job.source_sha256.slice(0, HASH_DIGITS));
    const cells: Record<(typeof COLUMNS)[number], Node | string> = {
      compare: box,
      name: link,
      kind: t(`kind.${job.kind}`),
      state: stateText(job),
      duration: job.summary?.duration_s === undefined ? "" : lasting(job.summary.duration_s, 0),
      blocks: String(job.summary?.blocks ?? ""),
      input,
      note: noteOf(job),
      error: errorOf(job),
      created: local(job.created_at),
    };
    const element = h(
      "tr",
      { testid: "job", "data-id": job.id, class: job.id === opened ? "opened" : "" },
      ...COLUMNS.map((name) => h("td", { class: name }, cells[name])),
      h("td", {}, removing),
    );
    element.dataset["state"] = job.state;
    return element;
  };

  const drawUndo = (): void => {
    undo.hidden = !deleted;
    undo.replaceChildren();
    if (!deleted) return;
    const last = deleted;
    const button = h("button", { type: "button", testid: "job-undo", t: "jobs.undo", onclick: () => void restore(last).catch(failed) });
    undo.append(t("jobs.deleted", { name: titleOf(last.job) }), " ", button);
  };

  const draw = (): void => {
    // A redraw would take the field away from whoever writes in it.
    if (body.contains(document.activeElement) && document.activeElement?.matches("[data-testid=job-note]")) return;
    body.replaceChildren(...found.map(row));
    ticked = ticked.filter((id) => found.some((job) => job.id === id));
    comparing.disabled = ticked.length < 2;
    comparing.hidden = found.length < 2;
    table.hidden = !found.length;
    empty.hidden = found.length > 0;
    drawUndo();
  };

  const refresh = (): void => {
    clearTimeout(timer);
    jobs().then((mine) => {
      found = mine;
      draw();
      if (mine.some(underWay) && !root.hidden) timer = window.setTimeout(refresh, AGAIN_MS);
    }, failed);
  };

  return {
    refresh,
    current(id) {
      opened = id;
      draw();
    },
    retranslate() {
      draw();
      comparison.retranslate();
    },
  };
}
