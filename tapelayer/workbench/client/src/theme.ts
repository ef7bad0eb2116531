import { remember, remembered } from "./data/state";

export const THEMES = ["auto", "light", "dark"] as const;
export type Theme = (typeof THEMES)[number];

const dark = matchMedia("(prefers-color-scheme: dark)");
const listeners: (() => void)[] = [];

export const currentTheme = (): Theme => remembered<Theme>("theme", "auto");

function apply(): void {
  const theme = currentTheme();
  document.documentElement.dataset["theme"] = theme === "auto" ? (dark.matches ? "dark" : "light") : theme;
  for (const listener of listeners) listener();
}

export function setTheme(theme: Theme): void {
  remember("theme", theme);
  apply();
}

/** Applies the remembered theme and calls the listener at every change. */
export function startTheme(listener: () => void): void {
  apply();
  listeners.push(listener);
  dark.addEventListener("change", apply);
}
