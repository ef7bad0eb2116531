import { deleteJob, jobs, underWay } from "../data/api";
import { h } from "../elements";
import { t } from "../i18n";
import type { Job } from "../data/types";

export interface JobList {
  refresh(): void;
  current(id: string): void;
  retranslate(): void;
}

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

/** The user's own jobs: open one, copy its link, delete it. */
export function createJobList(root: HTMLElement, open: (id: string) => void, removed: (id: string) => void, failed: (error: unknown) => void): JobList {
  const body = h("tbody");
  const heads = ["jobs.name", "jobs.kind", "jobs.state", "jobs.blocks", "jobs.created"].map((key) => h("th", { t: key, scope: "col" }));
  const table = h("table", { testid: "jobs", class: "jobs", tLabel: "tab.jobs" }, h("thead", {}, h("tr", {}, ...heads, h("td"))), body);
  const empty = h("p", { class: "about", t: "jobs.none" });
  root.append(table, empty);
  let found: Job[] = [];
  let opened = "";
  let timer = 0;

  const row = (job: Job): HTMLElement => {
    const remove = async (): Promise<void> => {
      await deleteJob(job.id);
      removed(job.id);
      refresh();
    };
    const name = h("a", { href: `#job=${job.id}`, title: job.name, onclick: () => open(job.id) }, job.name);
    const removing = h("button", { type: "button", class: "quiet", testid: "job-delete", t: "jobs.delete", onclick: () => void remove().catch(failed) });
    const cells = [t(`kind.${job.kind}`), t(stateKey(job)), job.summary ? String(job.summary.blocks) : "", local(job.created_at)];
    const element = h(
      "tr",
      { testid: "job", "data-id": job.id, class: job.id === opened ? "opened" : "" },
      h("td", {}, name),
      ...cells.map((text) => h("td", {}, text)),
      h("td", {}, removing),
    );
    element.dataset["state"] = job.state;
    return element;
  };

  const draw = (): void => {
    body.replaceChildren(...found.map(row));
    table.hidden = !found.length;
    empty.hidden = found.length > 0;
  };

  const refresh = (): void => {
    clearTimeout(timer);
    jobs().then((mine) => {
      found = mine;
      draw();
      if (mine.some(underWay) && !root.hidden) timer = window.setTimeout(refresh, 3000);
    }, failed);
  };

  return {
    refresh,
    current(id) {
      opened = id;
      draw();
    },
    retranslate: draw,
  };
}
