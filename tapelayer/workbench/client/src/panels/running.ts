import { cancelJob, createJob, kinds, watchJob, type Request } from "../data/api";
import { inWords } from "../data/quantities";
import { h } from "../elements";
import { t } from "../i18n";
import { stateKey, stateText } from "./jobs";
import type { Job, Words } from "../data/types";

export interface Running {
  readonly busy: boolean;
  /** Sends the job as soon as it is prepared, and follows it to its end; calls `accepted` once the server has it. */
  run(request: Promise<Request>, accepted: (job: Job) => void): Promise<Job>;
  /** Follows a waiting or running job. */
  follow(job: Job): Promise<Job>;
  /** Stops following; the job itself goes on. */
  leave(): void;
  /** Loads the names of the stages. */
  start(): void;
  retranslate(): void;
}

const LOST = "stage.lost";

/** Generate and cancel buttons, and the job's progress. */
export function createRunning(root: HTMLElement, generate: () => void, failed: (error: unknown) => void): Running {
  let leaving: AbortController | null = null;
  let running: Job | null = null;
  let stage = "";
  const names = new Map<string, Words>();
  let progress = 0;

  const start = h("button", { type: "button", testid: "generate", class: "primary", t: "generate", tTitle: "generate.about", onclick: generate });
  const stop = h("button", {
    type: "button",
    testid: "cancel",
    t: "cancel",
    onclick: () => {
      if (running) cancelJob(running.id).catch(failed);
      else leaving?.abort();
    },
  });
  const bar = h("progress", { testid: "progress", max: 1, tLabel: "progress" });
  const word = h("output", { testid: "stage", class: "stage", "aria-live": "polite" });
  root.append(h("div", { class: "row" }, start, stop), bar, word);

  const draw = (): void => {
    const busy = leaving !== null;
    start.disabled = busy;
    // Only a job's owner may cancel it; others may only follow it.
    stop.hidden = !busy || running?.mine === false;
    bar.hidden = !busy;
    bar.value = progress;
    const told = names.get(stage);
    const waits = running?.state === "queued" && stage === stateKey(running);
    const name = told ? inWords(told) : waits ? stateText(running!) : t(stage);
    word.textContent = stage && (busy && progress && stage !== LOST ? `${name} ${Math.floor(progress * 100)} %` : name);
    word.dataset["stage"] = stage;
  };

  const told = (job: Job): void => {
    running = job;
    progress = job.progress;
    stage = job.state === "running" && job.stage ? `stage.${job.stage}` : stateKey(job);
    draw();
  };

  const watch = async (find: (signal: AbortSignal) => Promise<Job>, accepted: (job: Job) => void): Promise<Job> => {
    leaving?.abort();
    const mine = new AbortController();
    leaving = mine;
    stage = "stage.sending";
    progress = 0;
    draw();
    try {
      const job = await find(mine.signal);
      told(job);
      accepted(job);
      const end = await watchJob(
        job.id,
        {
          onState: told,
          onProgress: (now, name) => told({ ...running!, state: "running", progress: now, stage: name }),
          onLost() {
            stage = LOST;
            draw();
          },
        },
        mine.signal,
      );
      stage = stateKey(end);
      return end;
    } catch (error) {
      if (leaving === mine) stage = "";
      throw error;
    } finally {
      // If the user has moved on to another job, `leaving` is already that job's controller.
      if (leaving === mine) {
        leaving = null;
        running = null;
        draw();
      }
    }
  };

  draw();
  return {
    get busy() {
      return leaving !== null;
    },
    run: (request, accepted) => watch(async (signal) => createJob(await request, signal), accepted),
    follow: (job) => watch(async () => job, () => {}),
    leave() {
      leaving?.abort();
      leaving = null;
      running = null;
      stage = "";
      draw();
    },
    start() {
      kinds().then((all) => {
        for (const { stages } of all) for (const { name, words } of stages) names.set(`stage.${name}`, words);
        draw();
      }, failed);
    },
    retranslate: draw,
  };
}
