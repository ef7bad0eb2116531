import en from "./locales/en.json";
import zh from "./locales/zh.json";
import type { Problem, Translate } from "./data/types";
import { remember, remembered } from "./data/state";

export const LANGUAGES = { en: "English", zh: "中文" };
export type Language = keyof typeof LANGUAGES;

const TEXTS: Record<Language, Record<string, string>> = { en, zh };

let language: Language = remembered<Language>("language", navigator.language.startsWith("zh") ? "zh" : "en");

export function currentLanguage(): Language {
  return language;
}

export function setLanguage(next: Language): void {
  language = next;
  remember("language", next);
  document.documentElement.lang = next;
}

/** Whether the page's language has its own text for the key. */
export function known(key: string): boolean {
  return key in TEXTS[language];
}

/** The text of a key with its `{name}` placeholders filled in; falls back to English, then to the key itself. */
export const t: Translate = (key, values = {}) => {
  const text = TEXTS[language][key] ?? TEXTS.en[key] ?? key;
  return text.replace(/\{(\w+)\}/g, (place, name: string) => String(values[name] ?? place));
};

/** A problem's heading: translated by its code, else the server's title. */
export function problemTitle(problem: Problem): string {
  const key = `problem.${problem.code}`;
  return known(key) ? t(key) : problem.title;
}
