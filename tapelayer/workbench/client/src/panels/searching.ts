import {
  SearchQuery,
  closeSearchPanel,
  getSearchQuery,
  gotoLine,
  openSearchPanel,
  search,
  setSearchQuery,
} from "@codemirror/search";
import { EditorSelection, type Extension, type Text } from "@codemirror/state";
import { EditorView, keymap, runScopeHandlers, type Panel, type ViewUpdate } from "@codemirror/view";
import { h, translateAll } from "../elements";
import { lowerBound } from "../views/motion";
import type { Translate } from "../data/types";

/** Where a text stands in another: the first character of each place, and the length of all or of each. */
interface Found {
  begins: number[];
  length: number | number[];
}

const NOTHING: Found = { begins: [], length: 0 };

/** The character after a place's last. */
function endOf({ begins, length }: Found, place: number): number {
  return begins[place]! + (typeof length === "number" ? length : length[place]!);
}

/** Places of a query in a text; the plain string is looked for at once, as the editor's cursor is slow in long ones. */
function find(text: string, folded: string, query: SearchQuery): Found {
  const { search: wanted, caseSensitive, regexp, wholeWord } = query;
  if (!query.valid) return NOTHING;
  const begins: number[] = [];
  if (!regexp && !wholeWord) {
    const [where, what] = caseSensitive ? [text, wanted] : [folded, wanted.toLowerCase()];
    for (let begin = where.indexOf(what); begin >= 0; begin = where.indexOf(what, begin + what.length)) begins.push(begin);
    return { begins, length: what.length };
  }
  const lengths: number[] = [];
  const pattern = regexp ? wanted : wanted.replace(/[\\^$.*+?()[\]{}|]/g, "\\$&");
  const look = new RegExp(wholeWord ? `(?<!\\w)(?:${pattern})(?!\\w)` : pattern, caseSensitive ? "gm" : "gim");
  for (let match = look.exec(text); match; match = look.exec(text)) {
    // A pattern that is content with nothing would stay where it is.
    if (!match[0]) look.lastIndex += 1;
    else {
      begins.push(match.index);
      lengths.push(match[0].length);
    }
  }
  return { begins, length: lengths };
}

class Searching implements Panel {
  readonly top = true;
  readonly dom: HTMLElement;
  private found = NOTHING;
  private query: SearchQuery;
  private doc: Text | null = null;
  private text = "";
  private folded = "";
  private readonly field = h("input", {
    ...{ class: "cm-textfield", name: "search", "main-field": "true", autocomplete: "off" },
    ...{ tLabel: "search.Find", tPlaceholder: "search.Find", oninput: () => this.ask() },
  });
  private readonly told = h("output", { testid: "search-count" });
  private readonly ticks = (["match_case", "regexp", "by_word"] as const).map((key) =>
    h("input", { type: "checkbox", name: key, onchange: () => this.ask() }),
  );

  constructor(
    private readonly view: EditorView,
    private readonly t: Translate,
  ) {
    this.query = getSearchQuery(view.state);
    const button = (key: string, act: () => void): HTMLElement =>
      h("button", { type: "button", class: "cm-button", name: key, t: `search.${key}`, onclick: act });
    this.dom = h(
      "div",
      { class: "cm-search", onkeydown: (event: KeyboardEvent) => this.press(event) },
      this.field,
      button("next", () => this.move(1)),
      button("previous", () => this.move(-1)),
      this.told,
      ...this.ticks.map((tick) => h("label", {}, tick, h("span", { t: `search.${tick.name}` }))),
      h("button", { type: "button", name: "close", tLabel: "search.close", onclick: () => closeSearchPanel(view) }, "×"),
    );
    this.fill();
  }

  mount(): void {
    this.field.select();
  }

  update(update: ViewUpdate): void {
    const query = getSearchQuery(update.state);
    if (!query.eq(this.query)) {
      this.query = query;
      this.fill();
    }
    if (update.transactions.some(({ reconfigured }) => reconfigured)) translateAll(this.dom);
    this.tell();
  }

  /** Goes to the next place, or the one before; round the ends of the program. */
  move(step: 1 | -1): void {
    const { begins } = this.found;
    if (!begins.length) return;
    const { from, to } = this.view.state.selection.main;
    const next = step > 0 ? lowerBound(begins, to) : lowerBound(begins, from) - 1;
    const place = (next + begins.length) % begins.length;
    const selection = EditorSelection.single(begins[place]!, endOf(this.found, place));
    const effects = EditorView.scrollIntoView(selection.main, { y: "center" });
    this.view.dispatch({ selection, effects, userEvent: "select.search" });
  }

  /** Takes the fields' values as what is looked for. */
  private ask(): void {
    const [caseSensitive, regexp, wholeWord] = this.ticks.map(({ checked }) => checked) as [boolean, boolean, boolean];
    this.query = new SearchQuery({ search: this.field.value, caseSensitive, regexp, wholeWord, literal: true });
    this.look();
    this.view.dispatch({ effects: setSearchQuery.of(this.query) });
  }

  private fill(): void {
    const { search: wanted, caseSensitive, regexp, wholeWord } = this.query;
    this.field.value = wanted;
    [caseSensitive, regexp, wholeWord].forEach((on, index) => (this.ticks[index]!.checked = on));
    this.look();
    this.tell();
  }

  private look(): void {
    const { doc } = this.view.state;
    if (doc !== this.doc) {
      this.doc = doc;
      this.text = doc.toString();
      this.folded = this.text.toLowerCase();
    }
    this.found = find(this.text, this.folded, this.query);
  }

  /** Says how many places there are, and which of them is selected. */
  private tell(): void {
    const { begins } = this.found;
    const { from, to } = this.view.state.selection.main;
    const place = lowerBound(begins, from);
    const values = { number: place + 1, count: begins.length };
    const key = begins.length === 0 ? "none" : begins[place] === from && endOf(this.found, place) === to ? "place" : "count";
    const told = this.query.search ? this.t(`search.${key}`, values) : "";
    if (this.told.textContent !== told) this.told.textContent = told;
  }

  private press(event: KeyboardEvent): void {
    if (runScopeHandlers(this.view, event, "search-panel")) event.preventDefault();
    else if (event.key === "Enter" && event.target === this.field) {
      event.preventDefault();
      this.move(event.shiftKey ? -1 : 1);
    }
  }
}

/** Search in a read-only program: its panel and its keys. */
export function searching(t: Translate): Extension {
  let panel: Searching | null = null;
  const both = "editor search-panel";
  const move = (view: EditorView, step: 1 | -1): boolean => {
    if (panel?.dom.isConnected) panel.move(step);
    else openSearchPanel(view);
    return true;
  };
  const next = { run: (view: EditorView) => move(view, 1), shift: (view: EditorView) => move(view, -1), scope: both };
  return [
    search({ top: true, createPanel: (view) => (panel = new Searching(view, t)) }),
    keymap.of([
      { key: "Mod-f", run: openSearchPanel, scope: both },
      { key: "F3", ...next, preventDefault: true },
      { key: "Mod-g", ...next, preventDefault: true },
      { key: "Escape", run: closeSearchPanel, scope: both },
      { key: "Mod-Alt-g", run: gotoLine },
    ]),
  ];
}
