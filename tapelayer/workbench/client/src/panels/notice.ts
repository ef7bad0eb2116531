import { Refused } from "../data/api";
import { h } from "../elements";
import { problemTitle, t } from "../i18n";
import { inLanguage, linked } from "./sentences";
import type { Fault, Kind, Problem } from "../data/types";

export interface Notice {
  /** `former` names the earlier results that are still shown. */
  show(problem: Problem, former?: string): void;
  /** Shows what was thrown, unless the user aborted. */
  report(error: unknown): void;
  clear(): void;
  retranslate(): void;
}

function place({ line, column }: Fault): string {
  if (!line) return "";
  return column ? t("problem.line-column", { line, column }) : t("problem.line", { line });
}

/** The form's parameters: of which kind of job, and how to get to one. */
export interface Parameters {
  kind(): Kind;
  go(section: string, key: string): void;
}

function sentences(problem: Problem, { kind, go }: Parameters): HTMLElement[] {
  const shown = (sentence: string): (Node | string)[] => linked(sentence, kind(), go);
  if (!problem.faults?.length) return [h("p", { class: "sentence" }, ...shown(inLanguage(problem, problem.detail)))];
  const rows = problem.faults.map((fault) => {
    const sentence = shown(inLanguage(fault, fault.sentence));
    return h("li", {}, h("span", { class: "line" }, place(fault)), h("span", { class: "sentence" }, ...sentence));
  });
  return [h("ul", { class: "faults" }, ...rows)];
}

/** Error messages, in the server's sentences, with links to the parameters that they name. */
export function createNotice(root: HTMLElement, parameters: Parameters): Notice {
  let current: Problem | null = null;
  let remaining = "";

  const draw = (): void => {
    root.replaceChildren();
    if (!current) return;
    const close = h("button", { type: "button", class: "quiet", tLabel: "close", testid: "problem-close", onclick: clear }, "✕");
    const code = h("a", { href: `/problems/${current.code}`, target: "_blank", class: "code" }, current.code);
    const reference = current.reference ? [h("p", { class: "about" }, t("problem.reference", { id: current.reference }))] : [];
    root.append(
      h(
        "div",
        { class: "problem", testid: "problem", tabindex: 0, "data-code": current.code },
        h("div", { class: "problem-head" }, h("strong", {}, problemTitle(current)), code, close),
        ...sentences(current, parameters),
        ...reference,
        ...(remaining ? [h("p", { class: "about former" }, t("problem.former", { name: remaining }))] : []),
      ),
    );
  };

  const show = (problem: Problem, former = ""): void => {
    current = problem;
    remaining = former;
    draw();
    root.firstElementChild!.scrollIntoView({ block: "nearest" });
  };

  const clear = (): void => {
    current = null;
    draw();
  };

  return {
    show,
    report(error) {
      if (error instanceof DOMException && error.name === "AbortError") return;
      if (error instanceof Refused) {
        show(error.problem);
        return;
      }
      show({ type: "", title: "", status: 0, code: "page", detail: error instanceof Error ? error.message : String(error) });
      throw error;
    },
    clear,
    retranslate: draw,
  };
}
