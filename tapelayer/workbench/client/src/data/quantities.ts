import { currentLanguage, t } from "../i18n";
import type { Failure, Judged, Quantity, Translate, Words } from "./types";

/** A text in the page's language. */
export const inWords = (words: Words): string => words[currentLanguage()];

// Digits from which on a number is written as a power of ten.
const POWER = 10;

/** A number with fixed digits and without a sign on zero; tiny ones as powers of ten. */
export function fixed(value: number, digits: number): string {
  if (digits >= POWER) return value.toExponential(1);
  const text = value.toFixed(digits);
  return /^-0\.?0*$/.test(text) ? text.slice(1) : text;
}

/** The wanted number of decimals, or fewer if a float32 of that size does not hold them. */
export function digitsOf(value: number, wanted: number): number {
  const size = Math.abs(value);
  return size < 2 ** 14 ? wanted : Math.min(size < 2 ** 17 ? 2 : 1, wanted);
}

/** A limit or a tick in the fewest digits. */
export function plain(value: number): string {
  return String(Number(value.toPrecision(7)));
}

/** The unit for display. */
const written = (unit: string): string => unit.replace("m2", "m²");

const MINUTE = 60;
const HOUR = 3600;

/** A duration in hours, minutes and seconds, from the largest of them that it has. */
export function lasting(seconds: number, digits: number): string {
  // Rounded first, so that no minute has sixty seconds; beside hours nobody reads parts of a second.
  const decimals = seconds < HOUR ? digits : 0;
  const whole = Number(seconds.toFixed(decimals));
  const [h, m] = [Math.floor(whole / HOUR), Math.floor((whole % HOUR) / MINUTE)];
  return t(h ? "duration.hours" : m ? "duration.minutes" : "duration.seconds", { h, m, s: fixed(whole % MINUTE, decimals) });
}

/** A quantity of the report with its unit, or why it has no value. */
export function shown(value: unknown, { absent, digits, style, unit }: Quantity): string {
  if (typeof value !== "number") return inWords(absent);
  if (unit === "s" && style === "fixed") return lasting(value, digits);
  return `${fixed(value, style === "power" ? POWER : digits)} ${written(unit)}`.trimEnd();
}

/** A share in percent, or that it was not measured. */
export function percent(value: number | null, t: Translate): string {
  return value === null ? t("report.not_measured") : `${fixed(value, 1)} %`;
}

const UNITS: [string, string][] = [
  ["_mm_per_s", "mm/s"],
  ["_deg_per_s", "deg/s"],
  ["_mm", "mm"],
  ["_deg", "deg"],
  ["_ms", "ms"],
  ["_m", "m"],
  ["_s", "s"],
];

/** Stem and unit of a key whose name ends in its unit. */
export function stemOf(key: string): { stem: string; unit: string } {
  const [ending, unit] = UNITS.find(([suffix]) => key.endsWith(suffix)) ?? ["", ""];
  return { stem: key.slice(0, key.length - ending.length), unit };
}

/** The name of a failure in words. */
export function failureName({ what }: Failure, { quantities }: Judged, t: Translate): string {
  const { stem } = stemOf(what);
  const axis = /^axis_(.+?)(_speed)?$/.exec(stem);
  if (axis) return t(axis[2] ? "failure.axis_speed" : "failure.axis_travel", { axis: axis[1]! });
  const device = /^(.+)_(switched_again|left_on|off_every_cut)$/.exec(stem);
  if (device) return t(`failure.${device[2]}`, { device: t(`device.${device[1]}`) });
  const moving = /^(rapid|stop|pause)_with_(.+)_on$/.exec(stem);
  if (moving) return t(`failure.${moving[1]}_with`, { device: t(`device.${moving[2]}`) });
  const measured = quantities.find(({ failure }) => failure === what);
  if (measured) return inWords(measured.words);
  const key = `failure.${stem}`;
  const text = t(key);
  return text === key ? stem.replaceAll("_", " ") : text;
}

// Decimals of a failure's value, and of one that is almost at its limit.
const DIGITS = 4;
const MOST_DIGITS = 9;

/** A failure's value with its unit, with enough digits to differ from the limit. */
export function failureValue({ limit, value, what }: Failure, t: Translate): string {
  if (value === null) return t("report.not_finite");
  if (Number.isInteger(value)) return limitValue(value, what);
  let digits = DIGITS;
  while (limit !== null && digits < MOST_DIGITS && Number(value.toFixed(digits)) === limit) digits += 1;
  return `${fixed(value, digits)} ${stemOf(what).unit}`.trimEnd();
}

/** The limit of a failure with its unit. */
export function limitValue(limit: number, what: string): string {
  return `${plain(limit)} ${stemOf(what).unit}`.trimEnd();
}
