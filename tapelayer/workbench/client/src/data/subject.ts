import type { Source } from "../panels/importing";
import { t } from "../i18n";
import type { Kind, SetupValues } from "./types";

/** What a job is made from: its files and its parameters. */
export interface Subject {
  kind: Kind;
  source: Source | null;
  mould: File | null;
  parts: File[];
  unit: string;
  values: SetupValues;
}

async function sameBytes(one: File, other: File): Promise<boolean> {
  if (one === other) return true;
  if (one.size !== other.size) return false;
  const [left, right] = (await Promise.all([one.arrayBuffer(), other.arrayBuffer()])).map((each) => new Uint8Array(each));
  return left!.every((byte, index) => byte === right![index]);
}

async function sameSource(one: Source | null, other: Source | null): Promise<boolean> {
  if (one === other) return true;
  if (!one || !other || one.name !== other.name) return false;
  return sameBytes(...(await Promise.all([one.file(), other.file()])));
}

/** Files that one of the two has and the other has not, or has with other content. */
async function otherFiles(one: File[], other: File[]): Promise<string[]> {
  const names = [...new Set([...one, ...other].map(({ name }) => name))];
  const changed = await Promise.all(
    names.map(async (name) => {
      const [left, right] = [one, other].map((files) => files.find((each) => each.name === name));
      return !left || !right || !(await sameBytes(left, right));
    }),
  );
  return names.filter((_, index) => changed[index]);
}

/** The name of a parameter on the page, with its section. */
export function parameterName(kind: Kind, section: string, key: string): string {
  return t("stale.field", { section: t(`setup.${kind}.${section}`), key: t(`setup.${kind}.${section}.${key}`) });
}

/** The names, on the page, of the parameters whose values differ. */
export function otherValues(kind: Kind, one: SetupValues, other: SetupValues): string[] {
  const sections = new Set([...Object.keys(one), ...Object.keys(other)]);
  return [...sections].flatMap((section) => {
    const [left, right] = [one[section] ?? {}, other[section] ?? {}];
    const keys = new Set([...Object.keys(left), ...Object.keys(right)]);
    return [...keys]
      .filter((key) => JSON.stringify(left[key]) !== JSON.stringify(right[key]))
      .map((key) => parameterName(kind, section, key));
  });
}

/** What differs between two jobs' subjects, in the page's language; empty if they are the same. */
export async function differences(made: Subject, now: Subject): Promise<string[]> {
  const found: string[] = [];
  if (!(await sameSource(made.source, now.source))) found.push(now.source?.name ?? t("import.none"));
  if (made.kind !== now.kind) return [...found, t(`kind.${now.kind}`)];
  if (made.unit !== now.unit) found.push(t("import.unit"));
  const mould = await otherFiles(made.mould ? [made.mould] : [], now.mould ? [now.mould] : []);
  if (mould.length) found.push(t("import.mould"));
  return [...found, ...(await otherFiles(made.parts, now.parts)), ...otherValues(now.kind, made.values, now.values)];
}
