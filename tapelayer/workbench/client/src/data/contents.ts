import type { Kind } from "./types";

/** What a file is by its content. */
export type Content = "courses" | "model" | "setup" | "program" | "part" | "unknown";

// As much as tells what a file is.
const HEAD_BYTES = 65536;
const STL_HEAD = 84;
const STL_FACET = 50;

/** Sections that the setups of each kind may have. */
const SECTIONS: Record<Kind, readonly string[]> = {
  lay: ["part", "machine", "tape", "head", "process", "verification", "output"],
  plan: ["mould", "ply", "tape", "gap", "courses", "limits"],
  spray: ["part", "machine", "spray", "process", "footprint", "verification", "output"],
};

const sections = (text: string): string[] => [...text.matchAll(/^\s*\[\s*([\w-]+)[\w.\s-]*\]/gm)].map((found) => found[1]!);

function decoded(bytes: Uint8Array): string | null {
  const [first, second] = bytes;
  const wide = first === 0xff && second === 0xfe ? "utf-16le" : first === 0xfe && second === 0xff ? "utf-16be" : null;
  const text = new TextDecoder(wide ?? "utf-8").decode(bytes);
  return /[\0-\x06\x0e-\x19]/.test(text) ? null : text;
}

/** The kinds whose setups may have all of these sections. */
function kindsOf(names: string[]): Kind[] {
  return (Object.keys(SECTIONS) as Kind[]).filter((kind) => names.every((name) => SECTIONS[kind].includes(name)));
}

async function head(file: File): Promise<Uint8Array> {
  return new Uint8Array(await file.slice(0, HEAD_BYTES).arrayBuffer());
}

/** What a file is: by its first bytes, and by its name only where these leave it open. */
// A start section: its letter in column 73, then the line's number.
const IGES = /^[^\n]{72}S[ 0]{6}1\r?\n/;

export async function contentOf(file: File): Promise<Content> {
  const bytes = await head(file);
  if (bytes.length >= STL_HEAD) {
    const facets = new DataView(bytes.buffer).getUint32(80, true);
    if (facets > 0 && file.size === STL_HEAD + STL_FACET * facets) return "model";
  }
  const text = decoded(bytes);
  if (/\.stl$/i.test(file.name) || (text && /^\s*solid\b[\s\S]*\bfacet\b/i.test(text))) return "model";
  if (text === null) return "unknown";
  if (text.startsWith("ISO-10303-21") || IGES.test(text)) return "model";
  if (/^\s*start\b/im.test(text) && /^\s*\d/.test(text.replace(/^\ufeff/, ""))) return "courses";
  if (/<robot\b/.test(text)) return "part";
  if (/^\s*[\w-]+\s*=/m.test(text) || sections(text).length) {
    const names = sections(text);
    if (names.length && kindsOf(names).length) return "setup";
    if (/\.toml$/i.test(file.name)) return "part";
  }
  if (/^\s*%|^\s*(N\d+\s*)?[GM]\d{1,3}\b/im.test(text)) return "program";
  // Two or more numbers in a line: a footprint's profile.
  if (/\.(csv|dat|tsv)$/i.test(file.name) && /^\s*[-+.\d][^\n]*[,;\s]\s*[-+.\d]/m.test(text)) return "part";
  return /\.txt$/i.test(file.name) ? "courses" : "unknown";
}

/** The kinds of job that a setup may be for, by its sections. */
export async function kindsOfSetup(file: File): Promise<Kind[]> {
  return kindsOf(sections(decoded(await head(file)) ?? ""));
}
