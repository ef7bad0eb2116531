import type { Clock } from "./data/types";

export interface Actions {
  search(): void;
  generate(): void;
  help(): void;
  tab(name: string): void;
}

const TABS: Record<string, string> = { 1: "verdict", 2: "plots", 3: "ledger", 4: "jobs" };
const LEAP = 100;

// Where keys already mean something.
const TYPING = "input:not([type=radio]):not([type=checkbox]), select, textarea, [contenteditable=true], .cm-editor";

/** Keys for what hands do most; none while something is typed or a dialog is open. */
export function startShortcuts(clock: Clock, actions: Actions): void {
  const plain: Record<string, (event: KeyboardEvent) => void> = {
    " ": () => clock.toggle(),
    ArrowLeft: ({ shiftKey }) => clock.step(shiftKey ? -LEAP : -1),
    ArrowRight: ({ shiftKey }) => clock.step(shiftKey ? LEAP : 1),
    Home: () => clock.seekTime(0),
    End: () => clock.seekTime(clock.duration),
    "?": () => actions.help(),
  };
  addEventListener("keydown", (event) => {
    if (event.defaultPrevented || document.querySelector("dialog[open]")) return;
    // The program's text has a tree of its own, whose events come out with its host for a target.
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
    // A button, a link or a heading that folds is pressed by the space bar.
    if (event.key === " " && target.closest("button, a, summary, label, input")) return;
    const tab = TABS[event.key];
    const action = tab ? () => actions.tab(tab) : plain[event.key];
    if (!action) return;
    event.preventDefault();
    action(event);
  });
}
