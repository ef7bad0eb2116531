import { h } from "../elements";
import { line, table, type Column } from "./tables";

// A table with more rows has only those in view in the page, and as many again beyond either edge.
const MOST = 200;
const BEYOND = 20;

/**
 * A table of which only the rows in view are drawn where it is long; what it says of itself counts all of them.
 *
 * @param scroller element that scrolls it. @param cells makes the cells of a row, from 0.
 */
export function longTable(
  scroller: HTMLElement,
  caption: string,
  columns: Column[],
  count: number,
  cells: (row: number) => (Node | string)[],
  foot: (Node | string)[][] = [],
): HTMLTableElement {
  const few = Array.from({ length: Math.min(count, count > MOST ? 1 : MOST) }, (_, row) => cells(row));
  const made = table(caption, columns, few, foot);
  if (count <= MOST) return made;
  const body = made.tBodies[0]!;
  const drawn = new Map<number, HTMLElement>([[0, body.rows[0]!]]);
  const [before, after] = [spacer(columns.length), spacer(columns.length)];
  made.setAttribute("aria-rowcount", String(1 + count + foot.length));
  made.tHead!.rows[0]!.setAttribute("aria-rowindex", "1");
  [...(made.tFoot?.rows ?? [])].forEach((row, index) => row.setAttribute("aria-rowindex", String(2 + count + index)));

  const draw = (): void => {
    if (!made.isConnected) {
      scroller.removeEventListener("scroll", draw);
      observer.disconnect();
      return;
    }
    const height = drawn.values().next().value?.getBoundingClientRect().height ?? 0;
    if (!height) return;
    const above = scroller.getBoundingClientRect().top - body.getBoundingClientRect().top;
    const end = Math.min(Math.max(Math.ceil((above + scroller.clientHeight) / height) + BEYOND, 1), count);
    const first = Math.min(Math.max(Math.floor(above / height) - BEYOND, 0), end - 1);
    if (drawn.size === end - first && drawn.has(first) && drawn.has(end - 1) && before.isConnected) return;
    const focused = body.contains(document.activeElement);
    for (const [row, element] of drawn) {
      if (row >= first && row < end) continue;
      element.remove();
      drawn.delete(row);
    }
    // The keys that scroll go on where the row with the focus is out of view.
    if (focused && !body.contains(document.activeElement)) scroller.focus({ preventScroll: true });
    if (!before.isConnected) body.append(before, ...drawn.values(), after);
    let next: Element = after;
    for (let row = end - 1; row >= first; row--) {
      const element = drawn.get(row) ?? line(columns, cells(row));
      element.setAttribute("aria-rowindex", String(row + 2));
      if (!element.isConnected) next.before(element);
      drawn.set(row, element);
      next = element;
    }
    (before.firstElementChild as HTMLElement).style.height = `${first * height}px`;
    (after.firstElementChild as HTMLElement).style.height = `${(count - end) * height}px`;
    // A column once wide stays so, or the table would tremble while it is scrolled.
    for (const cell of made.tHead!.rows[0]!.cells) cell.style.minWidth = `${cell.offsetWidth}px`;
  };
  const observer = new ResizeObserver(draw);
  if (!scroller.hasAttribute("tabindex")) scroller.tabIndex = -1;
  scroller.addEventListener("scroll", draw, { passive: true });
  observer.observe(scroller);
  return made;
}

function spacer(columns: number): HTMLElement {
  return h("tr", { class: "spacer", "aria-hidden": "true" }, h("td", { colspan: columns }));
}
