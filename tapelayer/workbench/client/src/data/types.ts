import type { Drawn } from "../views/board";
import type { Region } from "./api";
import type { Model, Unit } from "./model";

/** Kinds of job that make a program. */
export type ProgramKind = "lay" | "spray";
export type Kind = ProgramKind | "plan";

export type State = "queued" | "running" | "done" | "failed" | "cancelled";

/** What has its sentence in other languages, by their codes. */
export interface Told {
  translations?: Record<string, string>;
}

export interface Fault extends Told {
  line?: number | null;
  column?: number | null;
  sentence: string;
  section?: string | null;
  key?: string | null;
}

export interface Problem extends Told {
  type: string;
  title: string;
  status: number;
  detail: string;
  code: string;
  faults?: Fault[];
  failures?: Failure[];
  reference?: string;
}

export interface Failure extends Told {
  what: string;
  value: number | null;
  limit: number | null;
  line?: number;
  course?: number;
  point?: number;
  [key: string]: unknown;
}

export interface Summary {
  /** A plan has neither blocks nor a duration. */
  blocks?: number;
  duration_s?: number;
  courses?: number;
  passes?: number;
  passed: boolean;
  failures: number;
  bytes: number;
}

export interface Job {
  id: string;
  kind: Kind;
  name: string;
  /** Of the uploaded file; empty where it is not known. */
  source_sha256: string;
  title: string;
  note: string;
  state: State;
  progress: number;
  stage: string;
  /** In the queue, from 1; null where the job does not wait. */
  place: number | null;
  created_at: string;
  summary: Summary | null;
  error: Problem | null;
  results: string[];
  sent: { unit: string; mould: string; parts: string[]; from_job?: string };
  mine: boolean;
  owner_key?: string;
}

/** What differs between two jobs of one kind. */
export interface Comparison {
  kind: Kind;
  quantities: { key: string; a: number | null; b: number | null }[];
  setup: { section: string; key: string; a: unknown; b: unknown }[];
  files: { file: string; a: string; b: string }[];
}

export interface Table {
  columns: string[];
  rows: number;
  data: Float32Array;
  times: number[];
  unit: string;
  index(column: string): number;
  at(row: number, column: string): number;
  column(column: string): Float32Array;
}

export type TableName =
  | ("poses" | "speeds" | "errors" | "points" | "tape" | "part" | "coat")
  // Of a plan.
  | ("lines" | "gaps" | "boundary");

export interface Blocks {
  rows: number;
  /** Numbers from 1, a block each; 0 is the start. */
  blocks: number[];
  lines: number[];
  courses: number[];
  kinds: number[];
  kind_names: string[];
  events: number[];
  event_names: string[];
}

export type Report = Record<string, unknown> & {
  passed: boolean;
  failures: Failure[];
};

export type ProgramReport = Report & {
  program_sha256: string;
  axes: Record<string, AxisReport>;
};

export interface AxisReport {
  unit: string;
  min: number | null;
  max: number | null;
  lower: number | null;
  upper: number | null;
  max_speed: number | null;
  speed_limit: number | null;
}

export type SetupValues = Record<string, Record<string, unknown>>;

/** A text in every language of the page. */
export type Words = Record<"en" | "zh", string>;

/** A quantity of the report. */
export interface Quantity {
  key: string;
  words: Words;
  about: Words;
  /** Unit for display. */
  unit: string;
  /** Decimals. */
  digits: number;
  style: "count" | "fixed" | "power";
  group: "fact" | "error";
  /** Why it may have no value. */
  absent: Words;
  /** Whether it is shown beside the verdict. */
  headline: boolean;
  /** Name of its failure. */
  failure: string;
}

/** The quantities that jobs of a kind report, and their stages in order. */
export interface KindTold {
  kind: Kind;
  quantities: Quantity[];
  stages: { name: string; words: Words }[];
  /** What the verification of this kind does not judge, if the server tells. */
  not_judged?: Words[];
}

export interface Limit {
  value: number;
  /** Whether the limit is judged; if not, the quantity is only measured. */
  judged: boolean;
  /** Whether it is a least value, not a largest. */
  least?: boolean;
}

/** What a job made and how it was judged. */
export interface Judged {
  job: Job;
  report: Report;
  setup: SetupValues;
  changed: SetupValues;
  /** What the verification did not judge, if the server tells. */
  notJudged: Words[];
  /** In the order of the report. */
  quantities: Quantity[];
  /** Limits of the setup by the key of the quantity. */
  limits: Record<string, Limit>;
  url(what: "program" | "courses" | "report.json" | "report.html" | "trajectory" | "setup" | "source" | "urdf"): string;
  table(name: TableName): Promise<Table | null>;
}

/** A program. */
export interface Made extends Judged {
  kind: ProgramKind;
  report: ProgramReport;
  poses: Table;
  blocks: Blocks;
  /** Text of the program, to be read only where it failed; null where it could not even be written. */
  program: string | null;
}

/** A ply's courses. */
export interface Planned extends Judged {
  kind: "plan";
}

export type Translate = (key: string, values?: Record<string, string | number>) => string;

export interface Clock {
  readonly time: number;
  readonly row: number;
  readonly playing: boolean;
  readonly speed: number;
  readonly duration: number;
  seekTime(time_s: number): void;
  seekRow(row: number): void;
  seekLine(line: number): void;
  seekCourse(course: number): void;
  step(rows: number): void;
  play(): void;
  pause(): void;
  toggle(): void;
  setSpeed(factor: number): void;
  onChange(listener: () => void): () => void;
}

export interface Selection {
  readonly course: number;
  select(course: number): void;
  onChange(listener: (course: number) => void): () => void;
  /** Looks at a place on the mould, mm in its axes. */
  visit(place: [number, number, number]): void;
  onVisit(listener: (place: [number, number, number]) => void): void;
}

export interface Panel {
  show(made: Made): void;
  /** Shows a ply's courses, and how they differ from those shown before; panels without it have nothing to say of them. */
  plan?(planned: Planned, former: Planned | null): void;
  clear(): void;
  retranslate(): void;
  retheme?(): void;
  /** Tells what differs between what is set on the page and what is shown; nothing if they are the same. */
  outdated?(changes: string[]): void;
}

export interface ScenePanel extends Panel {
  idle(kind: Kind): void;
  /** Shows a mould as it was brought in; where it is `drawable`, a ply of these values can be drawn on it, whose courses may be planned. */
  mould(model: Model, unit: Unit, values: SetupValues, drawable: boolean, planned: Planned | null): void;
  /** Draws the ply's values on the mould. */
  ply(values: SetupValues): void;
  /** Draws what the ply covers; null: it is not known. */
  region(region: Region | null): void;
  /** Draws the courses of a plan on the mould; null: none. */
  plan(planned: Planned | null): void;
}

export interface ProgramPanel extends Panel {
  openSearch(): void;
}

export interface PlayerPanel extends Panel {
  readonly clock: Clock;
}

export type CreatePlayer = (root: HTMLElement, t: Translate) => PlayerPanel;

export type CreateScene = (
  root: HTMLElement,
  clock: Clock,
  t: Translate,
  selection: Selection,
  /** Takes what was drawn on a mould. */
  drawn: (drawn: Drawn) => void,
) => ScenePanel;

export type CreatePanel<P extends Panel = Panel> = (
  root: HTMLElement,
  clock: Clock,
  t: Translate,
  selection: Selection,
) => P;
