import type { Failure, Made, Translate } from "./panels";

/** A number of the report: its key, the unit it is shown in, digits behind the point. */
export interface Quantity {
  key: string;
  unit: string;
  digits: number;
}

const quantity = (key: string, unit: string, digits: number): Quantity => ({ key, unit, digits });

/** In the order of the printed report. */
export const FACTS = {
  lay: [
    quantity("courses", "", 0),
    quantity("points", "", 0),
    quantity("blocks", "", 0),
    quantity("laid_length_m", "m", 3),
    quantity("duration_s", "s", 1),
    quantity("tape_used_mm", "mm", 1),
    quantity("waste_mm", "mm", 1),
    quantity("waste_percent", "%", 2),
    quantity("cuts", "", 0),
    quantity("knife_conflicts", "", 0),
    quantity("laying_stops", "", 0),
  ],
  spray: [
    quantity("passes", "", 0),
    quantity("layers", "", 0),
    quantity("points", "", 0),
    quantity("blocks", "", 0),
    quantity("pitch_mm", "mm", 3),
    quantity("sprayed_area_m2", "m²", 4),
    quantity("duration_s", "s", 1),
    quantity("arc_time_s", "s", 1),
  ],
};

export const QUANTITIES = {
  lay: [
    quantity("max_position_error_mm", "mm", 4),
    quantity("max_chord_error_mm", "mm", 4),
    quantity("max_tape_error_mm", "mm", 4),
    quantity("max_roller_tilt_deg", "deg", 4),
    quantity("max_edge_lift_mm", "mm", 4),
    quantity("max_heading_error_deg", "deg", 4),
    quantity("max_pitch_deg", "deg", 3),
    quantity("max_wrap_mm", "mm", 3),
    quantity("max_roller_offset_mm", "mm", 4),
    quantity("max_cut_error_mm", "mm", 4),
    quantity("max_blade_error_deg", "deg", 4),
    quantity("taken_back_mm", "mm", 3),
    quantity("least_link_clearance_mm", "mm", 2),
    quantity("max_forward_disagreement_m", "m", 17),
  ],
  spray: [
    quantity("coverage_percent", "%", 2),
    quantity("cv_percent", "%", 2),
    quantity("cv_interior_percent", "%", 2),
    quantity("max_position_error_mm", "mm", 4),
    quantity("max_surface_distance_mm", "mm", 4),
    quantity("max_deviation_deg", "deg", 3),
    quantity("crease_length_mm", "mm", 1),
    quantity("max_crease_deviation_deg", "deg", 3),
    quantity("max_arc_distance_mm", "mm", 2),
    quantity("max_forward_disagreement_m", "m", 17),
  ],
};

/** Everything that a kind's report counts and measures. */
export const ALL = {
  lay: [...FACTS.lay, ...QUANTITIES.lay],
  spray: [...FACTS.spray, ...QUANTITIES.spray],
};

export interface Limit {
  value: number;
  /** False where the setup leaves the quantity free: it is measured, and fails nothing. */
  judged: boolean;
}

/** Limits of the setup by quantity, without the `max_` of the report's keys. */
export function limitsOf(made: Made): Map<string, Limit> {
  const limits = new Map<string, Limit>();
  const { verification = {}, spray = {}, process = {} } = made.setup;
  if (made.kind === "spray") {
    const position = Number(verification["max_position_error_mm"]);
    limits.set("position_error_mm", { value: position, judged: true });
    limits.set("surface_distance_mm", { value: Number(spray["chord_tolerance_mm"]) + position, judged: true });
    limits.set("deviation_deg", { value: Number(spray["max_deviation_deg"]), judged: true });
    return limits;
  }
  // The published form's pose is judged only where the setup asks for it.
  const free = process["kinematics"] === "published" ? ["max_roller_tilt_deg", "max_heading_error_deg"] : [];
  for (const [key, value] of Object.entries(verification)) {
    const judged = !free.includes(key) || key in (made.changed["verification"] ?? {});
    limits.set(key.replace("max_", ""), { value: Number(value), judged });
  }
  return limits;
}

/** A number with fixed digits and without a sign on zero; tiny ones as powers of ten. */
export function fixed(value: number, digits: number): string {
  if (digits > 9) return value.toExponential(1);
  const text = value.toFixed(digits);
  return /^-0\.?0*$/.test(text) ? text.slice(1) : text;
}

/** So many digits after the point as wanted, or as few as a float32 of a program's own word still holds. */
export function digitsOf(value: number, wanted: number): number {
  const size = Math.abs(value);
  return size < 2 ** 14 ? wanted : Math.min(size < 2 ** 17 ? 2 : 1, wanted);
}

/** A limit or a tick in the fewest digits. */
export function plain(value: number): string {
  return String(Number(value.toPrecision(7)));
}

// Why a quantity has no number, where it is not that it could not be measured.
const ABSENT: Record<string, string> = {
  least_link_clearance_mm: "report.no_link",
  max_crease_deviation_deg: "report.none",
  coverage_percent: "report.none",
  cv_percent: "report.none",
  cv_interior_percent: "report.none",
};

/** A number of the report with its unit, or why there is none. */
export function shown(value: unknown, { key, unit, digits }: Quantity, t: Translate): string {
  if (typeof value === "number") return `${fixed(value, digits)} ${unit}`.trimEnd();
  return t(ABSENT[key] ?? "report.not_measured");
}

const UNITS: [string, string][] = [
  ["_mm_per_s", "mm/s"],
  ["_deg_per_s", "deg/s"],
  ["_mm", "mm"],
  ["_deg", "deg"],
  ["_m", "m"],
  ["_s", "s"],
];

/** Stem and unit of a key that ends in its unit. */
export function stemOf(key: string): { stem: string; unit: string } {
  const [ending, unit] = UNITS.find(([suffix]) => key.endsWith(suffix)) ?? ["", ""];
  return { stem: key.slice(0, key.length - ending.length), unit };
}

/** What a failure is about, in words. */
export function failureName({ what }: Failure, t: Translate): string {
  const { stem } = stemOf(what);
  const axis = /^axis_(.+?)(_speed)?$/.exec(stem);
  if (axis) return t(axis[2] ? "failure.axis_speed" : "failure.axis_travel", { axis: axis[1]! });
  const device = /^(.+)_(switched_again|left_on|off_every_cut)$/.exec(stem);
  if (device) return t(`failure.${device[2]}`, { device: t(`device.${device[1]}`) });
  const moving = /^(rapid|stop|pause)_with_(.+)_on$/.exec(stem);
  if (moving) return t(`failure.${moving[1]}_with`, { device: t(`device.${moving[2]}`) });
  const measured = [...ALL.lay, ...ALL.spray].find(({ key }) => key.replace(/^(max|least)_/, "") === what);
  if (measured) return t(`quantity.${measured.key}`);
  const key = `failure.${stem}`;
  const text = t(key);
  return text === key ? stem.replaceAll("_", " ") : text;
}

// Digits behind the point of a failure's value, and of one that is as good as its limit.
const DIGITS = 4;
const MOST_DIGITS = 9;

/** A failure's value with its unit, in so many digits that it is not the limit. */
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
