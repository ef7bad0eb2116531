import { h } from "../elements";
import { currentLanguage, known } from "../i18n";
import { parameterName } from "../data/subject";
import type { Kind, Told } from "../data/types";

/** A parameter that the server names, as `[tape] width_mm`, or several of one section. */
const PARAMETERS = /\[(\w+)\] (\w+(?:(?:, |、)\w+)*)/g;

/** The server's sentence in the page's language, or in English where it has no other. */
export function inLanguage({ translations }: Told, english: string): string {
  return translations?.[currentLanguage()] ?? english;
}

/** A sentence in which each parameter has its name in the form, and leads to its field. */
export function linked(sentence: string, kind: Kind, go: (section: string, key: string) => void): (Node | string)[] {
  const nodes: (Node | string)[] = [];
  let from = 0;
  for (const { 0: found, 1: section = "", 2: listed = "", index } of sentence.matchAll(PARAMETERS)) {
    const keys = listed.split(/, |、/);
    if (!keys.every((key) => known(`setup.${kind}.${section}.${key}`))) continue;
    nodes.push(sentence.slice(from, index));
    keys.forEach((key, at) => {
      const title = `[${section}] ${key}`;
      const act = (): void => go(section, key);
      nodes.push(at ? ", " : "", h("button", { type: "button", class: "link", title, onclick: act }, parameterName(kind, section, key)));
    });
    from = index + found.length;
  }
  return [...nodes, sentence.slice(from)];
}
