import type { Selection } from "./types";

/** Settings that the browser keeps between visits: language, theme, sizes, the last setup. */
export function remembered<T>(key: string, otherwise: T): T {
  try {
    const text = localStorage.getItem(`tapelayer.${key}`);
    return text === null ? otherwise : (JSON.parse(text) as T);
  } catch {
    // The browser may deny storage, and another version may have stored something else.
    return otherwise;
  }
}

export function remember(key: string, value: unknown): void {
  try {
    localStorage.setItem(`tapelayer.${key}`, JSON.stringify(value));
  } catch {
    // Without storage the page still works, but forgets its settings.
  }
}

/** The selected course; 0 for none. */
export function createSelection(): Selection {
  const listeners = new Set<(course: number) => void>();
  const visitors: ((place: [number, number, number]) => void)[] = [];
  let course = 0;
  return {
    get course() {
      return course;
    },
    select(next) {
      course = next;
      for (const listener of listeners) listener(next);
    },
    onChange(listener) {
      listeners.add(listener);
      return () => listeners.delete(listener);
    },
    visit(place) {
      for (const visitor of visitors) visitor(place);
    },
    onVisit: (visitor) => void visitors.push(visitor),
  };
}
