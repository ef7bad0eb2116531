import "./tokens.css";
import "./style.css";
import * as api from "./data/api";
import type { Point } from "./data/outline";
import { differences, type Subject } from "./data/subject";
import { h, translateAll } from "./elements";
import { ask } from "./panels/asking";
import { kindsOfSetup } from "./data/contents";
import { KINDS } from "./data/kinds";
import { type Model, type Unit, UNITS } from "./data/model";
import { createForm } from "./panels/form";
import { createHelp } from "./panels/help";
import { currentLanguage, LANGUAGES, setLanguage, t, type Language } from "./i18n";
import { createImport, type Source } from "./panels/importing";
import { createJobList } from "./panels/jobs";
import { createLayout } from "./panels/layout";
import { createNotice } from "./panels/notice";
import type { Job, Kind, Made, Panel, Planned, ScenePanel, SetupValues } from "./data/types";
import { createRunning } from "./panels/running";
import { startShortcuts } from "./shortcuts";
import { startSession } from "./panels/signing";
import { createSelection } from "./data/state";
import { currentTheme, setTheme, startTheme, THEMES, type Theme } from "./theme";

const DOWNLOADS = ["report.html", "report.json", "setup"] as const;
// What a ply covers is asked for so long after the last change, for moulds of at most so many bytes.
const SURVEY_MS = 700;
const MOST_SURVEYED = 30e6;
// The panels of results are built at most this long after the start.
const LATEST_MS = 2000;

// Sent early, so that the server answers while the panels are built.
const session = api.session();
setLanguage(currentLanguage());
startTheme(() => panels.forEach((panel) => panel.retheme?.()));

const app = document.getElementById("app")!;
const layout = createLayout(app);
const selection = createSelection();
const notice = createNotice(layout.notice, {
  kind: () => input.kind,
  go: (section, key) => form.go(section, key),
});
const help = createHelp();

const badge = h("div", { class: "badge-place" });
const shown = h("output", { testid: "job-name", class: "job-name" });
const loading = h("output", { testid: "loading", class: "loading" });
const downloads = h("nav", { class: "downloads", tLabel: "downloads" });
const language = h("select", { testid: "language", tLabel: "language" });
const theme = h("select", { testid: "theme", tLabel: "theme" });
language.append(...Object.entries(LANGUAGES).map(([value, name]) => h("option", { value, lang: value }, name)));
theme.append(...THEMES.map((value) => h("option", { value, t: `theme.${value}` })));
language.value = currentLanguage();
theme.value = currentTheme();
language.addEventListener("change", () => retranslate(language.value as Language));
theme.addEventListener("change", () => setTheme(theme.value as Theme));
const settings = h("div", { class: "settings" }, language, theme);
layout.header.append(
  h("h1", {}, "tapelayer"),
  shown,
  loading,
  badge,
  downloads,
  h("button", { type: "button", testid: "clear", t: "clear", tTitle: "clear.about", onclick: () => clear() }),
  layout.folds,
  h("button", { type: "button", testid: "help", t: "help", onclick: () => help.showModal() }),
  settings,
);

let current: string | null = null;
let made: Made | Planned | null = null;
let scene: ScenePanel | null = null;
// The model that is looked at in place of a machine.
let presented: { model: Model; unit: Unit; kind: Kind } | null = null;
// What the job under way and what the shown one is made from.
let sent: Subject | null = null;
let subject: Subject | null = null;
let compared = 0;
let panels: Panel[] = [];
let idle: (kind: Kind) => void = () => {};

const importRoot = h("section", { class: "import" });
const formRoot = h("div", { testid: "setup-form", class: "form" });
const runRoot = h("section", { class: "run" });
const further = h("button", { type: "button", testid: "make-program", class: "primary", t: "ply.program", tTitle: "ply.program.about", onclick: () => void makeProgram() });
further.hidden = true;
const input = createImport(importRoot, changeKind, notice.report, compare, dropSetup, refuse);
const form = createForm(formRoot, () => input.parts.map(({ name }) => name), loadBoundary, compare);
const running = createRunning(runRoot, () => void generate(), notice.report);
runRoot.append(further);
const list = createJobList(layout.tab("jobs"), (id) => void open(id), (id) => id === current && clear(), notice.report);
layout.onTab((name) => name === "jobs" && list.refresh());

const loader = h("input", { type: "file", id: "load-setup", testid: "load-setup", accept: ".toml", class: "hidden-input" });
loader.addEventListener("change", () => void loadSetup());
layout.left.append(
  importRoot,
  h(
    "section",
    { class: "setup" },
    h(
      "header",
      {},
      h("h2", { t: "setup" }),
      h("span", { class: "picker" }, loader, h("label", { for: "load-setup", class: "button", t: "setup.load" })),
      h("button", { type: "button", testid: "save-setup", t: "setup.save", onclick: () => void saveSetup() }),
      h("button", { type: "button", testid: "reset-setup", t: "setup.reset", onclick: () => form.write({}) }),
    ),
    formRoot,
  ),
  runRoot,
);
document.title = t("page.title");

load(fromAddress() ?? "");
const signedIn = startSession(session, settings);
const started = start().catch(notice.report);
const furnished = furnish();

/** Builds the panels of results, which are slow to load, after the page is visible and usable. */
async function furnish(): Promise<void> {
  await Promise.race([started, new Promise((resolve) => setTimeout(resolve, LATEST_MS))]);
  await new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
  const results = await import("./panels/results");
  const player = results.createPlayer(layout.player, t);
  const { clock } = player;
  scene = results.createScene(layout.scene, clock, t, selection, (drawn) => form.put("ply", { ...drawn }));
  const program = results.createProgram(layout.program, clock, t, selection);
  panels = [
    player,
    scene,
    program,
    results.createBadge(badge, clock, t, selection),
    results.createVerdict(layout.tab("verdict"), clock, t, selection),
    results.createPlots(layout.tab("plots"), clock, t, selection),
    results.createLedger(layout.tab("ledger"), clock, t, selection),
  ];
  idle = (kind) => scene!.idle(kind);
  startShortcuts(clock, {
    search() {
      layout.reveal("program");
      program.openSearch();
    },
    generate: () => void generate(),
    help: () => help.showModal(),
    tab: layout.showTab,
    fold: layout.fold,
    fill: layout.fill,
  });
  addEventListener("hashchange", () => {
    const id = fromAddress();
    if (id && id !== current) void open(id);
  });
  try {
    await signedIn;
  } catch {
    // The error is reported by `start`.
    return;
  }
  if (!made) idle(input.kind);
  present();
  const id = fromAddress();
  if (id && id !== current) void open(id);
}

/** Fills the choices that come from the server. */
async function start(): Promise<void> {
  await signedIn;
  input.start();
  running.start();
  app.dataset["kind"] = input.kind;
  await form.show(input.kind);
}

function changeKind(kind: Kind): void {
  app.dataset["kind"] = kind;
  running.name(kind);
  form.show(kind).then(present, notice.report);
  if (!made) idle(kind);
}

/** The parameters as they are sent, with those of the source that the page has beside the form. */
function values(): SetupValues {
  const set = form.values();
  const { source: section } = KINDS[input.kind];
  if (!section) return set;
  const unit = input.unit === "mm" ? {} : { unit: input.unit };
  return { ...set, [section]: { file: input.source?.name ?? "mould.stl", ...unit } };
}

/** Fills in the parameters, in the form and beside it. */
function write(set: SetupValues): void {
  const { source: section } = KINDS[input.kind];
  if (section) input.measure((set[section]?.["unit"] ?? "mm") as Unit);
  form.write(set);
}

/** Draws the boundary and the holes that a file has. */
function loadBoundary(file: File): void {
  const { unit } = input;
  const scaled = (points: Point[]): Point[] => points.map((point) => point.map((value) => value / UNITS[unit]) as Point);
  api.boundaryLoops(file, unit).then(({ points_mm: boundary, holes_mm: holes }) => {
    form.put("ply", { boundary: scaled(boundary), holes: holes.map(scaled) });
    notice.clear();
  }, notice.report);
}

let surveying: AbortController | null = null;
let surveyed = "";

/** Asks what the ply covers, a while after the last change, and marks the fields that are wrong. */
function survey(): void {
  const { kind, source } = input;
  const asked = KINDS[kind].drawn && source && form.sound(kind) ? JSON.stringify([source.name, values()]) : "";
  if (asked === surveyed) return;
  surveyed = asked;
  surveying?.abort();
  surveying = null;
  if (!asked || !source) return;
  const { signal } = (surveying = new AbortController());
  setTimeout(() => {
    if (signal.aborted) return;
    look(source, signal).catch((error: unknown) => {
      if (signal.aborted) return;
      scene?.region(null);
      // What is wrong with the mould or the server is told where something is done with them.
      if (error instanceof api.Refused) form.faults(error.problem.faults ?? []);
    });
  }, SURVEY_MS);
}

async function look(source: Source, signal: AbortSignal): Promise<void> {
  const file = await source.file();
  if (file.size > MOST_SURVEYED) return;
  const ply = await api.formatSetup(input.kind, values());
  const region = await api.findRegion(file, ply, input.parts, signal);
  if (!signal.aborted) scene?.region(region);
}

/** Shows the model that was imported in place of a machine, until there is a program for it. */
function present(): void {
  if (!scene) return;
  const { kind, model, unit, source } = input;
  form.measure(unit);
  const ours = made !== null && made.kind === kind && subject?.source === source;
  const wanted = model && KINDS[kind].model && (!ours || made!.kind === "plan") ? { model, unit, kind } : null;
  const same = wanted?.model === presented?.model && wanted?.unit === presented?.unit && wanted?.kind === presented?.kind;
  const before = presented;
  presented = wanted;
  if (wanted && same) scene.ply(values());
  else if (wanted) scene.mould(model!, unit, values(), KINDS[kind].drawn, ours ? (made as Planned) : null);
  else if (before && made && made.kind !== "plan") scene.show(made);
  else if (before) idle(kind);
  survey();
}

async function loadSetup(): Promise<void> {
  const [file] = loader.files ?? [];
  loader.value = "";
  if (!file) return;
  try {
    // Values that are written before there are fields would be lost.
    await started;
    write(await api.parseSetup(input.kind, await file.text()));
    notice.clear();
  } catch (error) {
    // These faults concern values in the file, not those in the form.
    notice.report(error);
  }
}

/** Loads a setup that was dropped; asks where that replaces parameters, and refuses one of another kind. */
async function dropSetup(file: File): Promise<void> {
  const kinds = await kindsOfSetup(file);
  if (kinds.length === 1 && kinds[0] !== input.kind) {
    refuse([t("import.refused.kind", { name: file.name, kind: t(`kind.${kinds[0]}`) })]);
    return;
  }
  const changed = Object.values(form.values()).reduce((sum, section) => sum + Object.keys(section).length, 0);
  if (changed) {
    const choices = { load: t("ask.setup.load"), keep: t("ask.setup.keep") };
    const answer = await ask("ask.setup", t("ask.setup.about", { name: file.name, count: changed }), choices);
    if (answer !== "load") return;
  }
  write(await api.parseSetup(input.kind, await file.text()));
  notice.clear();
}

function refuse(sentences: string[]): void {
  const faults = sentences.map((sentence) => ({ sentence }));
  notice.show({ type: "", title: "", status: 0, code: "not-taken", detail: sentences.join(" "), faults });
}

async function saveSetup(): Promise<void> {
  try {
    const text = await api.formatSetup(input.kind, values(), true);
    const url = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
    h("a", { href: url, download: `${input.kind}.toml` }).click();
    URL.revokeObjectURL(url);
  } catch (error) {
    refused(error);
  }
}

/** What the page would make a job from. */
function now(): Subject {
  const { kind, source, mould, parts, unit } = input;
  return { kind, source, mould, parts: [...parts], unit, values: values() };
}

/** Tells the panels how what is set differs from what the shown job was made from. */
function compare(): void {
  const turn = ++compared;
  present();
  further.hidden = !(made?.kind === "plan" && made.job.results.includes("courses") && input.kind === made.kind);
  if (!subject) {
    for (const panel of panels) panel.outdated?.([]);
    return;
  }
  differences(subject, now()).then((changes) => {
    // A later change is compared by its own call.
    if (turn !== compared) return;
    downloads.classList.toggle("stale", changes.length > 0);
    for (const panel of panels) panel.outdated?.(changes);
  }, notice.report);
}

function refused(error: unknown): void {
  if (error instanceof api.Refused) form.faults(error.problem.faults ?? []);
  notice.report(error);
}

async function generate(): Promise<void> {
  if (running.busy) return;
  if (!input.source) {
    notice.show({ type: "", title: "", status: 0, code: "no-file", detail: t("problem.no-file.detail") });
    layout.reveal("left");
    input.askForFile();
    return;
  }
  if (!form.check()) {
    layout.reveal("left");
    return;
  }
  notice.clear();
  try {
    sent = now();
    await ended(await running.run(request(input.source, values()), accepted));
  } catch (error) {
    refused(error);
  }
}

/** Makes the program of the plan that is shown, with the parameters of the kind that does so. */
async function makeProgram(): Promise<void> {
  if (made?.kind !== "plan" || running.busy) return;
  const plan = made;
  const next = KINDS[plan.kind].next!;
  const name = api.coursesName(plan.job.name);
  input.bring({ name, plan: plan.job, file: () => api.coursesFile(plan.job) }, next, "mm", null, []);
  await form.show(next);
  const { width_mm } = plan.setup["tape"] ?? {};
  form.put("tape", { width_mm });
  await generate();
}

async function request(source: Source, values: SetupValues): Promise<api.Request> {
  const { kind, unit, mould, parts } = input;
  const setup = Object.keys(values).length ? await api.formatSetup(kind, values) : "";
  return { file: source.plan ?? (await source.file()), kind, setup, unit, mould, parts };
}

/** Puts the job into the page's address, so that a reload or a shared link opens it. */
function accepted(job: Job): void {
  current = job.id;
  location.hash = `job=${job.id}`;
  list.current(job.id);
  list.refresh();
}

async function ended(job: Job): Promise<void> {
  list.refresh();
  const judgedBad = job.error?.code === "verification-failed";
  if (job.state === "done" || judgedBad) await show(job);
  if (job.state === "failed" && job.error && !judgedBad) notice.show(job.error, made?.job.name);
  form.faults(job.error?.faults ?? []);
}

async function show(job: Job): Promise<void> {
  const [loaded] = await Promise.all([api.load(job), furnished]);
  // The user may have moved on to another job meanwhile.
  if (job.id !== current) return;
  const former = made;
  selection.select(0);
  subject = sent;
  made = loaded;
  for (const panel of panels) {
    if (loaded.kind !== "plan") panel.show(loaded);
    else if (panel.plan) panel.plan(loaded, former?.kind === "plan" && former.job.id !== job.id ? former : null);
    else panel.clear();
  }
  // What was on the stage is no longer looked at.
  if (loaded.kind !== "plan") presented = null;
  drawHeader(loaded);
  compare();
}

/** Shows a job with its file and its parameters, and follows it if it has not ended. */
async function open(id: string): Promise<void> {
  current = id;
  load(id);
  running.leave();
  notice.clear();
  try {
    const job = await api.job(id);
    const [setup, mould, ...parts] = await Promise.all([
      api.jobSetup(job),
      api.mouldFile(job),
      ...job.sent.parts.map((name) => api.partFile(job, name)),
    ]);
    if (id !== current) return;
    accepted(job);
    const source = { name: job.name, file: () => api.sourceFile(job) };
    input.bring(source, job.kind, job.sent.unit as Unit, mould, parts);
    await form.show(job.kind);
    write(setup);
    sent = now();
    if (api.underWay(job)) load("");
    await ended(api.underWay(job) ? await running.follow(job) : job);
  } catch (error) {
    if (id === current && error instanceof api.Refused && error.problem.code === "not-found") current = null;
    notice.report(error);
  } finally {
    if (id === current || !current) load("");
  }
}

/** Says that a job is loaded; an empty id that none is. */
function load(id: string): void {
  loading.textContent = id && t("loading", { id: id.slice(0, 8) });
  app.setAttribute("aria-busy", String(id !== ""));
}

function fileName({ name }: Job, what: (typeof DOWNLOADS)[number] | "courses"): string {
  if (what === "courses") return api.coursesName(name);
  return `${name.replace(/\.\w+$/, "")}.${what === "setup" ? "toml" : what.replace("report.", "")}`;
}

function drawHeader(loaded: Made | Planned | null): void {
  made = loaded;
  shown.textContent = loaded?.job.name ?? "";
  shown.title = loaded ? `${loaded.job.name} · ${loaded.job.id}` : "";
  if (!loaded) {
    downloads.replaceChildren();
    return;
  }
  const of = t("download.of", { name: loaded.job.name, id: loaded.job.id.slice(0, 8) });
  const queries = { courses: "", "report.html": `?language=${currentLanguage()}`, "report.json": "", setup: "?whole=true" };
  const whats = [...(loaded.kind === "plan" && loaded.job.results.includes("courses") ? (["courses"] as const) : []), ...DOWNLOADS];
  const links = whats.map((what) => {
    const testid = `download-${what.replace(".", "-")}`;
    const texts = { t: `download.${what}`, title: `${t(`download.${what}.about`)} · ${of}` };
    const href = loaded.url(what) + queries[what];
    return h("a", { href, download: fileName(loaded.job, what), testid, class: "button", ...texts });
  });
  const about = { title: `${t("report.look")} · ${of}`, "aria-label": t("report.look") };
  const look = h("a", { href: loaded.url("report.html"), target: "_blank", testid: "look-at-report", class: "button", ...about }, "↗");
  downloads.replaceChildren(look, ...links);
}

function clear(): void {
  running.leave();
  current = null;
  history.replaceState(null, "", location.pathname);
  notice.clear();
  input.clear();
  list.current("");
  selection.select(0);
  for (const panel of panels) panel.clear();
  subject = null;
  drawHeader(null);
  compare();
  idle(input.kind);
}

function retranslate(next: Language): void {
  setLanguage(next);
  document.title = t("page.title");
  translateAll(document.body);
  for (const each of [...panels, notice, form, input, running, list]) each.retranslate();
  drawHeader(made);
  compare();
}

function fromAddress(): string | undefined {
  return /^#job=(.+)$/.exec(location.hash)?.[1];
}
