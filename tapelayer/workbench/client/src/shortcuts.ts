import type { Clock } from "./data/types";
import type { Foldable } from "./panels/layout";

export interface Actions {
  search(): void;
  generate(): void;
  help(): void;
  tab(name: string): void;
  fold(name: Foldable): void;
  fill(): void;
}

const TABS: Record<string, string> = { 1: "verdict", 2: "plots", 3: "ledger", 4: "jobs" };
const LEAP = 100;

// Elements where keys already have a meaning.
const TYPING = "input:not([type=radio]):not([type=checkbox]), select, textarea, [contenteditable=true], .cm-editor";

/** Shortcuts for frequent actions; inactive while typing or while a dialog is open. */
export function startShortcuts(clock: Clock, actions: Actions): void {
  const plain: Record<string, (event: KeyboardEvent) => void> = {
    " ": () => clock.toggle(),
    ArrowLeft: ({ shiftKey }) => clock.step(shiftKey ? -LEAP : -1),
    ArrowRight: ({ shiftKey }) => clock.step(shiftKey ? LEAP : 1),
    Home: () => clock.seekTime(0),
    End: () => clock.seekTime(clock.duration),
    "?": () => actions.help(),
    i: () => actions.fold("left"),
    n: () => actions.fold("program"),
    t: () => actions.fold("dock"),
    m: () => actions.fill(),
  };
  addEventListener("keydown", (event) => {
    if (event.defaultPrevented || document.querySelector("dialog[open]")) return;
    // Events from the program's shadow root are retargeted to its host; the path has the real target.
    const target = event.composedPath()[0];
    if (!(target instanceof Element)) return;
    if (event.ctrlKey || event.metaKey) {
      const action = { f: actions.search, Enter: actions.generate }[event.key];
      if (!action) return;
      event.preventDefault();
      action();
      return;
    }
    if (event.altKey || target.closest(TYPING)) return;
    // The space bar activates a focused button, link or collapsible heading.
    if (event.key === " " && target.closest("button, a, summary, label, input")) return;
    const tab = TABS[event.key];
    const action = tab ? () => actions.tab(tab) : (plain[event.key] ?? plain[event.key.toLowerCase()]);
    if (!action) return;
    event.preventDefault();
    action(event);
  });
}
