import "./results.css";
import { standardKeymap } from "@codemirror/commands";
import { openSearchPanel } from "@codemirror/search";
import { Compartment, EditorSelection, EditorState, RangeSet, StateEffect, StateField, type Range } from "@codemirror/state";
import {
  Decoration,
  EditorView,
  MatchDecorator,
  ViewPlugin,
  keymap,
  lineNumbers,
  type DecorationSet,
  type ViewUpdate,
} from "@codemirror/view";
import { h } from "../elements";
import { lowerBound } from "../views/motion";
import { FIRST, KINDS } from "../data/kinds";
import type { Blocks, Clock, CreatePanel, Made, ProgramPanel, Selection, Translate } from "../data/types";
import { searching } from "./searching";

// The program follows a playing clock no more often than the eye can.
const FOLLOW_MS = 120;
const TOLD_MS = 2500;
// Comments are in parentheses (but not a function's arguments) or after a semicolon; `Q1=` is an extended address.
const WORDS = /(;.*|(?<![A-Za-z])\([^)]*\)?)|\b(N\d+)|\b(G\d+(?:\.\d+)?)|\b(M\d+)|\b(F[-+.\d]+)|\b([A-Z](?:\d*=)?)[-+.\d]+/g;
const CLASSES = ["nc-comment", "nc-number", "nc-g", "nc-m", "nc-feed", "nc-axis"];
const MARKS = CLASSES.map((name) => Decoration.mark({ class: name }));
const CURRENT = Decoration.line({ class: "nc-current", attributes: { "aria-current": "true" } });
const CHOSEN = Decoration.line({ class: "nc-chosen" });
const PHRASES = ["Go to line", "go", "close"];

/** Lines of a course in the program, from 1, including its comment. */
interface Stretch {
  course: number;
  from: number;
  to: number;
}

const colours = new MatchDecorator({
  regexp: WORDS,
  decorate(add, from, to, match) {
    const group = match.findIndex((found, index) => index > 0 && found !== undefined);
    // Of a word with a value, only the address is styled.
    add(from, group === 6 ? from + match[6]!.length : to, MARKS[group - 1]!);
  },
});

const coloured = ViewPlugin.define(
  (view) => ({
    decorations: colours.createDeco(view),
    update(update: ViewUpdate) {
      this.decorations = colours.updateDeco(update, this.decorations);
    },
  }),
  { decorations: (plugin) => plugin.decorations },
);

const goTo = StateEffect.define<number>();
const choose = StateEffect.define<Stretch | null>();

/** The line where the machine is, from 1; 0 for none. */
const currentLine = StateField.define<number>({
  create: () => 0,
  update: (line, { effects }) => effects.reduce((found, effect) => (effect.is(goTo) ? effect.value : found), line),
  provide: (field) =>
    EditorView.decorations.from(field, (line) => (view) => {
      const shown = line > 0 && line <= view.state.doc.lines;
      return shown ? RangeSet.of(CURRENT.range(view.state.doc.line(line).from)) : Decoration.none;
    }),
});

const chosenStretch = StateField.define<Stretch | null>({
  create: () => null,
  update: (stretch, { effects }) =>
    effects.reduce<Stretch | null>((found, effect) => (effect.is(choose) ? effect.value : found), stretch),
});

/** The visible lines of the selected course. */
function chosenLines(view: EditorView): DecorationSet {
  const stretch = view.state.field(chosenStretch);
  if (!stretch) return Decoration.none;
  const { doc } = view.state;
  const marks: Range<Decoration>[] = [];
  const first = Math.max(doc.lineAt(view.viewport.from).number, stretch.from);
  const last = Math.min(doc.lineAt(view.viewport.to).number, stretch.to);
  for (let line = first; line <= last; line++) marks.push(CHOSEN.range(doc.line(line).from));
  return RangeSet.of(marks);
}

const chosen = ViewPlugin.define(
  (view) => ({
    decorations: chosenLines(view),
    update(update: ViewUpdate) {
      const changed = update.transactions.some(({ effects }) => effects.some((effect) => effect.is(choose)));
      if (changed || update.viewportChanged) this.decorations = chosenLines(update.view);
    },
  }),
  { decorations: (plugin) => plugin.decorations },
);

// The editor is in a shadow root, where the page's style sheet does not apply but its variables do.
const look = EditorView.theme({
  "&": { height: "100%", fontSize: "0.8125rem", color: "var(--text)", backgroundColor: "var(--panel)" },
  "&.cm-focused": { outline: "2px solid var(--focus)", outlineOffset: "-2px" },
  ".cm-scroller": { fontFamily: "var(--mono)", lineHeight: "1.45" },
  ".cm-content": { caretColor: "var(--text)" },
  ".cm-gutters": { backgroundColor: "var(--raised)", color: "var(--dim)", borderRight: "1px solid var(--line)" },
  ".cm-content ::selection, .cm-line::selection": { backgroundColor: "var(--accent-soft)" },
  ".nc-comment": { color: "var(--nc-comment)" },
  ".nc-number": { color: "var(--nc-number)" },
  ".nc-g": { color: "var(--nc-g)", fontWeight: "600" },
  ".nc-m": { color: "var(--nc-m)", fontWeight: "600" },
  ".nc-feed": { color: "var(--nc-feed)" },
  ".nc-axis": { color: "var(--nc-axis)", fontWeight: "700" },
  ".nc-chosen": { boxShadow: "inset 0.25rem 0 var(--accent)" },
  ".nc-current": { backgroundColor: "var(--current)", boxShadow: "inset 0.25rem 0 var(--warn)" },
  ".cm-searchMatch": { backgroundColor: "var(--warn-soft)", outline: "1px solid var(--warn)" },
  ".cm-searchMatch-selected": { backgroundColor: "var(--current)", outline: "2px solid var(--warn)" },
  ".cm-panels": { backgroundColor: "var(--raised)", color: "var(--text)" },
  ".cm-panels-top": { borderBottom: "1px solid var(--line)" },
  ".cm-panel.cm-search": { padding: "0.35rem 1.75rem 0.35rem 0.5rem", fontFamily: "var(--sans)" },
  ".cm-panel.cm-search label": { fontSize: "0.8125rem" },
  ".cm-textfield": {
    fontSize: "0.8125rem",
    color: "var(--text)",
    backgroundColor: "var(--panel)",
    border: "1px solid var(--strong-line)",
  },
  ".cm-button": {
    fontSize: "0.8125rem",
    color: "var(--text)",
    backgroundColor: "var(--panel)",
    backgroundImage: "none",
    border: "1px solid var(--strong-line)",
  },
  ".cm-panel.cm-search output": { minWidth: "5rem", display: "inline-block", padding: "0 0.4rem" },
  ".cm-panel.cm-search [name=close]": { color: "var(--text)", fontSize: "1rem" },
  "input:focus-visible, button:focus-visible": { outline: "2px solid var(--focus)", outlineOffset: "1px" },
});

/** The range of lines of each course, in program order. */
function stretchesOf({ courses, lines }: Blocks, text: string[]): Stretch[] {
  const found: Stretch[] = [];
  courses.forEach((course, row) => {
    const line = lines[row]!;
    if (!course || !line) return;
    const last = found.at(-1);
    if (last?.course === course) last.to = line;
    else found.push({ course, from: line, to: line });
  });
  found.forEach((stretch, index) => {
    const before = found[index - 1]?.to ?? 0;
    for (let line = stretch.from - 1; line > before; line--) {
      if (!/\b(course|pass)\s+\d+/i.test(text[line - 1]!)) continue;
      stretch.from = line;
      break;
    }
  });
  return found;
}

class ProgramView implements ProgramPanel {
  private made: Made | null = null;
  private editor: EditorView | null = null;
  private stretches: Stretch[] = [];
  private followed = 0;
  private frame = 0;
  private readonly words = new Compartment();
  private readonly select = h("select", { testid: "course-select" });
  private readonly find = h("button", { type: "button", testid: "program-search" });
  private readonly copy = h("button", { type: "button", testid: "copy-program" });
  private readonly download = h("a", { class: "button", testid: "download-program" });
  private readonly bar = h("div", { class: "program-bar" }, this.select, this.find, this.copy, this.download);
  private readonly host = h("div", { class: "program-text", testid: "program" });
  private readonly why = h("p", { class: "withheld", role: "status", testid: "program-withheld" });
  private readonly instead = h("p", { class: "empty program-instead" });

  constructor(
    root: HTMLElement,
    private readonly clock: Clock,
    private readonly t: Translate,
    selection: Selection,
  ) {
    root.classList.add("program-panel");
    // Removing the editor from the page, even briefly, would lose its scroll position.
    root.append(this.bar, this.why, this.instead, this.host);
    // The editor uses constructed style sheets, which the page's policy allows only in a shadow root.
    this.host.attachShadow({ mode: "open" });
    this.host.addEventListener("keydown", (event) => this.keepKeys(event));
    this.find.addEventListener("click", () => this.openSearch());
    this.copy.addEventListener("click", () => void this.copied());
    this.select.addEventListener("change", () => {
      const course = Number(this.select.value);
      selection.select(course);
      clock.seekCourse(course);
    });
    clock.onChange(() => this.ask());
    selection.onChange((course) => this.showCourse(course));
    this.close();
    this.retranslate();
  }

  show(made: Made): void {
    this.close();
    this.made = made;
    if (made.program === null) {
      this.render();
      return;
    }
    this.editor = new EditorView({
      state: this.stateOf(made.program),
      parent: this.host.shadowRoot!,
      root: this.host.shadowRoot!,
    });
    const { doc } = this.editor.state;
    this.stretches = stretchesOf(made.blocks, doc.toJSON());
    this.select.append(...this.stretches.map(({ course }) => new Option("", String(course))));
    this.render();
    this.follow(true);
  }

  clear(): void {
    this.close();
    this.render();
  }

  retranslate(): void {
    const { t } = this;
    this.find.textContent = t("program.search");
    this.find.title = t("program.search_title");
    this.copy.textContent = t("program.copy");
    this.copy.title = t(navigator.clipboard ? "program.copy_title" : "program.copy_refused");
    this.download.textContent = t("program.download");
    const place = this.editor?.scrollSnapshot();
    this.editor?.dispatch({ effects: this.words.reconfigure(this.phrases()) });
    // Reconfiguring the editor loses its scroll position, so restore it.
    if (place) this.editor?.dispatch({ effects: place });
    this.render();
  }

  openSearch(): void {
    if (this.editor) openSearchPanel(this.editor);
  }

  dispose(): void {
    this.close();
  }

  private close(): void {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
    this.editor?.destroy();
    this.editor = null;
    this.made = null;
    this.stretches = [];
    this.select.replaceChildren(new Option("", "0"));
  }

  /** Shows the program, or the reason why there is none; one that failed can be read, and is not given away. */
  private render(): void {
    const { made, t } = this;
    const program = made?.program ?? null;
    const failed = made !== null && !made.report.passed;
    for (const control of [this.select, this.find, this.copy]) control.disabled = program === null;
    this.copy.disabled ||= failed || !navigator.clipboard;
    const what = KINDS[made?.kind ?? FIRST].part;
    const heading = t(`program.${what}`);
    this.select.setAttribute("aria-label", heading);
    for (const option of this.select.options) {
      option.textContent = option.value === "0" ? heading : t(`place.${what}`, { course: option.value });
    }
    if (made && program !== null && !failed) {
      this.download.href = made.url("program");
      this.download.download = "";
    } else this.download.removeAttribute("href");
    this.why.hidden = !failed;
    this.why.textContent = t(program === null ? "program.unwritten" : "program.withheld");
    this.host.classList.toggle("failed", failed);
    this.host.dataset["watermark"] = failed ? t("program.watermark") : "";
    this.instead.textContent = t("program.empty");
    this.instead.hidden = made !== null;
    this.host.hidden = program === null;
  }

  private stateOf(program: string): EditorState {
    const keptBack = (event: Event): boolean => this.keptBack(event);
    return EditorState.create({
      doc: program,
      extensions: [
        EditorState.readOnly.of(true),
        lineNumbers(),
        coloured,
        currentLine,
        chosenStretch,
        chosen,
        look,
        searching(this.t),
        keymap.of([{ key: "Space", run: () => this.toggle() }, ...standardKeymap]),
        this.words.of(this.phrases()),
        EditorView.updateListener.of((update) => this.moved(update)),
        EditorView.domEventHandlers({ copy: keptBack, cut: keptBack, dragstart: keptBack }),
      ],
    });
  }

  private phrases(): ReturnType<typeof EditorState.phrases.of>[] {
    const told = PHRASES.map((phrase) => [phrase, this.t(`search.${phrase.replaceAll(" ", "_")}`)]);
    const label = EditorView.contentAttributes.of({ "aria-label": this.t("program.text"), "aria-readonly": "true", tabindex: "0" });
    return [EditorState.phrases.of(Object.fromEntries(told)), label] as ReturnType<typeof EditorState.phrases.of>[];
  }

  /** Lets nobody take a program along that failed. */
  private keptBack(event: Event): boolean {
    const failed = !this.made!.report.passed;
    if (failed) event.preventDefault();
    return failed;
  }

  /** Moves the machine to a line that the user goes to. */
  private moved(update: ViewUpdate): void {
    if (!update.transactions.some((transaction) => transaction.isUserEvent("select"))) return;
    const { main } = update.state.selection;
    // Selecting text does not mean going to its end.
    if (!main.empty && !update.transactions.some((transaction) => transaction.isUserEvent("select.search"))) return;
    const line = update.state.doc.lineAt(main.from).number;
    const lines = this.made!.blocks.lines;
    const row = lowerBound(lines, line);
    this.clock.pause();
    this.clock.seekLine(lines[Math.min(row, lines.length - 1)]!);
    this.follow(false);
  }

  /** Lets the space bar play here as well, since the program is read-only. */
  private toggle(): boolean {
    this.clock.toggle();
    return true;
  }

  /** Keeps keys that the editor uses from triggering the page's shortcuts. */
  private keepKeys(event: KeyboardEvent): void {
    const [target] = event.composedPath();
    const typing = target instanceof HTMLInputElement;
    if (typing || event.defaultPrevented || /^(Arrow|Page|Home|End)/.test(event.key)) event.stopPropagation();
  }

  private ask(): void {
    if (!this.editor || this.frame) return;
    this.frame = requestAnimationFrame((now) => {
      this.frame = 0;
      if (this.clock.playing && now - this.followed < FOLLOW_MS) return;
      this.followed = now;
      this.follow(true);
    });
  }

  /** Marks the line of the clock's block, and scrolls to it unless it is already in view. */
  private follow(scroll: boolean): void {
    const { editor, made } = this;
    if (!editor || !made) return;
    const line = made.blocks.lines[this.clock.row] ?? 0;
    this.select.value = String(made.blocks.courses[this.clock.row] ?? 0);
    if (line === editor.state.field(currentLine) || line > editor.state.doc.lines) return;
    const effects: StateEffect<unknown>[] = [goTo.of(line)];
    if (line && scroll) {
      const place = editor.lineBlockAt(editor.state.doc.line(line).from);
      const { scrollTop, clientHeight } = editor.scrollDOM;
      const margin = 2 * editor.defaultLineHeight;
      const visible = place.top >= scrollTop + margin && place.bottom <= scrollTop + clientHeight - margin;
      if (!visible) effects.push(EditorView.scrollIntoView(place.from, { y: "center" }));
    }
    editor.dispatch({ effects });
  }

  /** Selects the lines of a course. */
  private showCourse(course: number): void {
    const { editor } = this;
    if (!editor) return;
    const stretch = this.stretches.find((found) => found.course === course) ?? null;
    if (!stretch) {
      editor.dispatch({ effects: choose.of(null) });
      return;
    }
    const { doc } = editor.state;
    const range = EditorSelection.range(doc.line(stretch.to).to, doc.line(stretch.from).from);
    const effects: StateEffect<unknown>[] = [choose.of(stretch)];
    // Where the machine stands on the course, its line is the one to see.
    const there = this.made!.blocks.courses[this.clock.row] === course;
    if (!there) effects.push(EditorView.scrollIntoView(range.head, { y: "start", yMargin: 2 * editor.defaultLineHeight }));
    editor.dispatch({ selection: range, effects });
  }

  private async copied(): Promise<void> {
    const told = await navigator.clipboard.writeText(this.made!.program!).then(
      () => "program.copied",
      () => "program.copy_refused",
    );
    this.copy.textContent = this.t(told);
    setTimeout(() => (this.copy.textContent = this.t("program.copy")), TOLD_MS);
  }
}

/** The NC program: highlighted, searchable, and scrolled to the machine's current block. */
export const createProgram: CreatePanel<ProgramPanel> = (root, clock, t, selection) =>
  new ProgramView(root, clock, t, selection);
