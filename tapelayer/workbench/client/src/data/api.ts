import { KINDS } from "./kinds";
import type { Point } from "./outline";
import type {
  Blocks,
  Comparison,
  Job,
  Judged,
  Kind,
  KindTold,
  Limit,
  Made,
  Planned,
  Problem,
  ProgramReport,
  Report,
  SetupValues,
  Table,
  TableName,
} from "./types";

const ROOT = "/api/v1";

/** A refusal by the server, with its problem details; code `unreachable` if it did not answer. */
export class Refused extends Error {
  constructor(readonly problem: Problem) {
    super(problem.detail);
  }
}

export interface Example {
  name: string;
  kind: Kind;
  title: string;
}

export interface Controller {
  name: string;
  title: string;
}

export interface Session {
  token_required: boolean;
  signed_in: boolean;
  version: string;
}

export interface Request {
  /** What it is made from: a file, or the job that made it. */
  file: File | Job;
  kind: Kind;
  setup: string;
  unit: string;
  mould: File | null;
  parts: File[];
}

let signedIn: () => Promise<void> = () => Promise.resolve();

/** Sets the function that waits for a token; requests refused without one are repeated after it. */
export function onUnauthorized(wait: () => Promise<void>): void {
  signedIn = wait;
}

function ask(path: string, init: RequestInit = {}): Promise<Response> {
  return reach(ROOT + path, init);
}

/** Fetches an address of this server; throws on a refusal. */
export async function reach(address: string, init: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(address, init);
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new Refused({ type: "", title: "", status: 0, code: "unreachable", detail: String(error) });
  }
  if (response.ok) return response;
  const problem = await problemOf(response);
  if (problem.code !== "token-required") throw new Refused(problem);
  await signedIn();
  return reach(address, init);
}

async function problemOf(response: Response): Promise<Problem> {
  if (response.headers.get("content-type")?.includes("json")) return (await response.json()) as Problem;
  const { status, statusText } = response;
  return { type: "", title: statusText, status, code: "internal", detail: `${status} ${statusText}` };
}

async function askJson<T>(path: string, init?: RequestInit): Promise<T> {
  return (await (await ask(path, init)).json()) as T;
}

function postJson(path: string, value: unknown): Promise<Response> {
  return ask(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(value) });
}

/** A table of little-endian float32 values as the server sends it. */
function tableOf(data: Float32Array, columns: string[], times: number[] = [], unit = ""): Table {
  const width = columns.length;
  const rows = width ? data.length / width : 0;
  const index = (name: string): number => columns.indexOf(name);
  return {
    columns,
    rows,
    data,
    times,
    unit,
    index,
    at: (row, name) => data[row * width + index(name)] ?? Number.NaN,
    column(name) {
      const from = index(name);
      const values = new Float32Array(rows);
      if (from < 0) return values.fill(Number.NaN);
      for (let row = 0; row < rows; row++) values[row] = data[row * width + from]!;
      return values;
    },
  };
}

function listed(response: Response, header: string): string[] {
  const text = response.headers.get(header) ?? "";
  return text ? text.split(",").map((name) => name.trim()) : [];
}

async function table(id: string, name: TableName): Promise<Table> {
  const response = await ask(`/jobs/${id}/${name}`);
  const times = listed(response, "X-Times").map(Number);
  const columns = listed(response, "X-Columns");
  return tableOf(new Float32Array(await response.arrayBuffer()), columns, times, response.headers.get("X-Unit") ?? "");
}

export const session = (): Promise<Session> => askJson("/session");
export const signIn = (token: string): Promise<Response> => postJson("/session", { token });
export const signOut = (): Promise<Response> => ask("/session", { method: "DELETE" });

export interface Schema {
  type?: string;
  description?: string;
  default?: unknown;
  enum?: string[];
  const?: unknown;
  anyOf?: Schema[];
  items?: Schema;
  properties?: Record<string, Schema>;
  required?: string[];
  additionalProperties?: Schema | boolean;
  $ref?: string;
  $defs?: Record<string, Schema>;
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  exclusiveMaximum?: number;
}

const answers = new Map<string, Promise<unknown>>();

/** Fetches data that stays the same while the server runs, once; fetches again only after a failure. */
function askOnce<T>(path: string): Promise<T> {
  const found = answers.get(path) ?? askJson<T>(path);
  answers.set(path, found);
  found.catch(() => answers.delete(path));
  return found as Promise<T>;
}

/** The quantities and stages of each kind of job. */
export async function kinds(): Promise<KindTold[]> {
  return (await askOnce<{ kinds: KindTold[] }>("/quantities")).kinds;
}

/** JSON schema of a kind's setup. */
export const setupSchema = (kind: Kind): Promise<Schema> => askOnce(`/setup-schema?kind=${kind}`);

/** The values of a setup, with the default of every key that is not set. */
function effective(schema: Schema, values: SetupValues): SetupValues {
  const sections = Object.entries(schema.properties ?? {});
  return Object.fromEntries(
    sections.map(([name, { default: defaults }]) => [name, { ...(defaults as object), ...values[name] }]),
  );
}

export interface Machine {
  name: string;
  title: string;
  axes: { name: string; unit: string; lower: number; upper: number; speed: number }[];
  frames: string[];
}

export async function machines(): Promise<Machine[]> {
  return (await askOnce<{ machines: Machine[] }>("/machines")).machines;
}

export async function controllers(): Promise<Controller[]> {
  return (await askOnce<{ controllers: Controller[] }>("/controllers")).controllers;
}

export async function examples(): Promise<Example[]> {
  return (await askJson<{ examples: Example[] }>("/examples")).examples;
}

export async function exampleFile(name: string): Promise<File> {
  return new File([await (await ask(`/examples/${encodeURIComponent(name)}`)).blob()], name);
}

/** The course file that a plan made. */
export async function coursesFile({ id, name }: Job): Promise<File> {
  return new File([await (await ask(`/jobs/${id}/courses`)).blob()], coursesName(name));
}

/** The name of the course file that is made on a mould. */
export const coursesName = (mould: string): string => mould.replace(/\.\w+$/, ".txt");

/** The file that a job was made from. */
export async function sourceFile({ id, name }: Job): Promise<File> {
  return new File([await (await ask(`/jobs/${id}/source`)).blob()], name);
}

/** A file sent along with a job, by its name. */
export async function partFile({ id }: Job, name: string): Promise<File> {
  return new File([await (await ask(`/jobs/${id}/parts/${encodeURIComponent(name)}`)).blob()], name);
}

/** The mould sent along with a job; null if there is none. */
export async function mouldFile({ id, sent }: Job): Promise<File | null> {
  return sent.mould ? new File([await (await ask(`/jobs/${id}/mould`)).blob()], sent.mould) : null;
}

export async function jobs(): Promise<Job[]> {
  return (await askJson<{ jobs: Job[] }>("/jobs")).jobs;
}

export const job = (id: string): Promise<Job> => askJson(`/jobs/${encodeURIComponent(id)}`);
export const restoreJob = (id: string): Promise<Job> => askJson(`/jobs/${id}/restore`, { method: "POST" });
export const compareJobs = (a: string, b: string): Promise<Comparison> => askJson(`/jobs/compare?a=${a}&b=${b}`);
export const cancelJob = (id: string): Promise<Response> => ask(`/jobs/${id}/cancel`, { method: "POST" });

/** Changes the note of a job. */
export function noteJob(id: string, note: string): Promise<Job> {
  const init = { method: "PATCH", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ note }) };
  return askJson(`/jobs/${id}`, init);
}

export const deleteJob = (id: string): Promise<Response> => ask(`/jobs/${id}`, { method: "DELETE" });

export async function parseSetup(kind: Kind, toml: string): Promise<SetupValues> {
  const init = { method: "POST", headers: { "Content-Type": "text/plain" }, body: toml };
  return (await askJson<{ values: SetupValues }>(`/setup/parse?kind=${kind}`, init)).values;
}

/** Values as TOML; whole: with the default and the meaning of every other key, too. */
export async function formatSetup(kind: Kind, values: SetupValues, whole = false): Promise<string> {
  return (await postJson("/setup/format", { kind, values, whole })).text();
}

export function createJob(request: Request, signal: AbortSignal): Promise<Job> {
  const form = new FormData();
  if (request.file instanceof File) form.append("file", request.file);
  else form.append("from_job", request.file.id);
  form.append("kind", request.kind);
  if (request.setup) form.append("setup", request.setup);
  if (KINDS[request.kind].unit && !KINDS[request.kind].source) form.append("unit", request.unit);
  if (request.mould) form.append("mould", request.mould);
  for (const part of request.parts) form.append("parts", part);
  return askJson("/jobs", { method: "POST", body: form, signal });
}

export interface Watch {
  onState(job: Job): void;
  onProgress(progress: number, stage: string): void;
  /** Called when the server does not answer; the request is repeated until it does. */
  onLost(): void;
}

// Delay before a request that was not answered is repeated.
const AGAIN_MS = 1500;

export const underWay = ({ state }: Job): boolean => state === "queued" || state === "running";

/** Follows a job to its end, reconnecting as needed; returns the ended job. */
export async function watchJob(id: string, watch: Watch, signal: AbortSignal): Promise<Job> {
  for (;;) {
    const end = await listen(id, watch, signal);
    if (end) return end;
    try {
      const now = await job(id);
      if (!underWay(now)) return now;
    } catch (error) {
      if (!(error instanceof Refused) || error.problem.code !== "unreachable") throw error;
      watch.onLost();
    }
    await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    signal.throwIfAborted();
  }
}

/** Listens to a job's events until it ends; null if the connection broke before. */
function listen(id: string, watch: Watch, signal: AbortSignal): Promise<Job | null> {
  return new Promise((resolve, reject) => {
    const source = new EventSource(`${ROOT}/jobs/${id}/events`);
    const told = (event: MessageEvent<string>): Job => JSON.parse(event.data) as Job;
    const leave = (): void => {
      source.close();
      reject(signal.reason);
    };
    const close = (end: Job | null): void => {
      signal.removeEventListener("abort", leave);
      source.close();
      resolve(end);
    };
    signal.addEventListener("abort", leave);
    source.addEventListener("state", (event) => watch.onState(told(event)));
    source.addEventListener("progress", (event) => {
      const { progress, stage } = told(event);
      watch.onProgress(progress, stage);
    });
    source.addEventListener("done", (event) => close(told(event)));
    source.addEventListener("error", () => close(null));
  });
}

/** The values that a job's setup sets. */
export async function jobSetup({ id, kind }: Job): Promise<SetupValues> {
  return parseSetup(kind, await (await ask(`/jobs/${id}/setup`)).text());
}

function formOf(file: File, unit: string): FormData {
  const form = new FormData();
  form.append("file", file);
  form.append("unit", unit);
  return form;
}

/** Asks what the server says of a mould, which refuses what is no model. */
export const lookAtMould = (file: File, unit: string): Promise<Response> =>
  ask("/mould", { method: "POST", body: formOf(file, unit) });

/** The closed lines of a boundary's file, mm. */
export const boundaryLoops = (file: File, unit: string): Promise<{ points_mm: Point[]; holes_mm: Point[][] }> =>
  askJson("/boundary", { method: "POST", body: formOf(file, unit) });

/** What a ply covers on its mould. */
export interface Region {
  area_m2: number;
  /** The boundary after its inset, then the holes. */
  rings_mm: Point[][];
  seed_mm: Point;
}

/** Finds what a ply covers, without planning it. */
export function findRegion(mould: File, ply: string, parts: File[], signal: AbortSignal): Promise<Region> {
  const form = new FormData();
  form.append("file", mould);
  form.append("setup", ply);
  for (const part of parts) form.append("parts", part);
  return askJson("/region", { method: "POST", body: form, signal });
}

/** The tables of a job's results, each fetched once; null for those that it has not. */
function tablesOf(made: Job): Judged["table"] {
  const tables = new Map<TableName, Promise<Table | null>>();
  return (name) => {
    const found = tables.get(name) ?? (made.results.includes(name) ? table(made.id, name) : Promise.resolve(null));
    tables.set(name, found);
    return found;
  };
}

/** What is told of every job's results, of one that passed or was judged bad. */
async function judged(made: Job): Promise<Judged> {
  const path = `/jobs/${made.id}`;
  const [report, changed, schema, told, { limits }] = await Promise.all([
    askJson<Report>(`${path}/report.json`),
    jobSetup(made),
    setupSchema(made.kind),
    kinds(),
    askJson<{ limits: Record<string, Limit> }>(`${path}/limits`),
  ]);
  const { quantities, not_judged: notJudged = [] } = told.find((each) => each.kind === made.kind)!;
  return {
    job: made,
    report,
    setup: effective(schema, changed),
    changed,
    quantities,
    notJudged,
    limits,
    url: (what) => `${ROOT}${path}/${what}`,
    table: tablesOf(made),
  };
}

/** The results that the page shows at once; the rest is fetched on demand. */
export async function load(made: Job): Promise<Made | Planned> {
  const { kind } = made;
  if (kind === "plan") return { ...(await judged(made)), kind };
  const path = `/jobs/${made.id}`;
  const [shared, poses, blocks, program, withheld] = await Promise.all([
    judged(made),
    table(made.id, "poses"),
    askJson<Blocks>(`${path}/blocks`),
    // The server withholds a program that was judged bad.
    made.results.includes("program") ? ask(`${path}/program`).then((response) => response.text()) : null,
    made.results.includes("withheld") ? askJson<{ lines: string[] }>(`${path}/withheld`) : null,
  ]);
  const report = shared.report as ProgramReport;
  return { ...shared, kind, report, poses, blocks, program: program ?? withheld?.lines.join("\n") ?? null };
}
