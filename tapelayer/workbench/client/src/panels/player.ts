import "./player.css";
import { h, translateAll } from "../elements";
import { type Motion, motionOf } from "../views/motion";
import { FIRST } from "../data/kinds";
import type { Clock, CreatePlayer, Kind, Made } from "../data/types";
import { digitsOf, fixed } from "../data/quantities";
import { Ruler } from "./ruler";

const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 20, 50];
const DIGITS = 3;
// A longer pause means that the page was in the background: playing resumes where it stopped.
const LONGEST_FRAME_S = 1;

function timeText(time_s: number): string {
  const minutes = Math.floor(time_s / 60);
  const seconds = (Math.floor(time_s * 1000) / 1000 - 60 * minutes).toFixed(3).padStart(6, "0");
  const short = String(minutes % 60).padStart(2, "0");
  return minutes >= 60 ? `${Math.floor(minutes / 60)}:${short}:${seconds}` : `${short}:${seconds}`;
}

class Player implements Clock {
  time = 0;
  row = 0;
  playing = false;
  speed = 1;
  motion: Motion | null = null;
  private readonly listeners = new Set<() => void>();
  private last = 0;
  private frame = 0;

  get duration(): number {
    return this.motion?.duration ?? 0;
  }

  /** Fraction of the motion to the row that is done. */
  get done(): number {
    // Among rows of equal time, the machine stands at the requested one.
    return this.motion ? this.motion.done(this.row, this.time) : 1;
  }

  load(motion: Motion | null): void {
    this.pause();
    this.motion = motion;
    this.row = 0;
    this.time = 0;
    this.tell();
  }

  seekTime(time_s: number): void {
    if (!this.motion || Number.isNaN(time_s)) return;
    this.time = Math.min(Math.max(time_s, 0), this.duration);
    this.row = this.motion.rowAt(this.time);
    this.tell();
  }

  seekRow(row: number): void {
    if (!this.motion?.rows || Number.isNaN(row)) return;
    this.row = Math.min(Math.max(Math.round(row), 0), this.motion.rows - 1);
    this.time = this.motion.times[this.row]!;
    this.tell();
  }

  seekLine(line: number): void {
    if (this.motion) this.seekRow(this.motion.rowOfLine(line));
  }

  seekCourse(course: number): void {
    const row = this.motion?.rowOfCourse(course) ?? -1;
    if (row >= 0) this.seekRow(row);
  }

  step(blocks: number): void {
    this.pause();
    if (this.motion?.rows) this.seekRow(this.motion.stepped(this.row, this.done, blocks));
  }

  play(): void {
    if (!this.motion?.rows || this.playing) return;
    if (this.time >= this.duration) this.seekRow(0);
    this.playing = true;
    this.last = performance.now();
    this.frame = requestAnimationFrame(this.advance);
    this.tell();
  }

  pause(): void {
    if (!this.playing) return;
    this.playing = false;
    cancelAnimationFrame(this.frame);
    this.tell();
  }

  toggle(): void {
    if (this.playing) this.pause();
    else this.play();
  }

  setSpeed(factor: number): void {
    this.speed = factor;
    this.tell();
  }

  onChange(listener: () => void): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  private readonly advance = (now: number): void => {
    if (!this.playing) return;
    const passed = Math.min(Math.max((now - this.last) / 1000, 0), LONGEST_FRAME_S);
    this.last = now;
    const time = this.time + passed * this.speed;
    if (time >= this.duration) {
      this.playing = false;
      this.seekRow(this.motion!.rows - 1);
      return;
    }
    this.frame = requestAnimationFrame(this.advance);
    this.seekTime(time);
  };

  private tell(): void {
    for (const listener of this.listeners) listener();
  }
}

function control(testid: string, key: string, sign: string, onclick: () => void): HTMLButtonElement {
  return h("button", { type: "button", testid, tTitle: key, tLabel: key, onclick }, sign);
}

/** The page's clock, with its transport bar and the readout of the axes. */
export const createPlayer: CreatePlayer = (root, t) => {
  const player = new Player();
  const back = control("step-back", "player.back", "❙◀", () => player.step(-1));
  const play = control("play", "player.play", "▶", () => player.toggle());
  const forward = control("step-forward", "player.forward", "▶❙", () => player.step(1));
  const scrub = h("input", {
    ...{ type: "range", min: 0, max: 0, step: "any", value: 0, testid: "scrub" },
    ...{ tTitle: "player.scrub", tLabel: "player.scrub" },
  });
  const factors = SPEEDS.map((factor) => new Option(`${factor}×`, String(factor), factor === 1, factor === 1));
  const speed = h("select", { testid: "speed", tTitle: "player.speed", tLabel: "player.speed" }, ...factors);
  const now = h("output", { class: "player-time", testid: "clock-time" });
  const place = h("output", { class: "player-place", testid: "clock-place" });
  const lamps = h("div", { class: "player-lamps" });
  const ruler = new Ruler(t);
  const axes = h("dl", { class: "player-axes", tLabel: "player.axes" });
  const values: HTMLElement[] = [];
  const lights: HTMLElement[] = [];
  let kind: Kind = FIRST;
  let shown: Made | null = null;
  root.classList.add("player");
  root.append(
    h("div", { class: "player-bar" }, back, play, forward, h("div", { class: "player-track" }, scrub, ruler.element), speed, now),
    h("div", { class: "player-below" }, place, ruler.legend, lamps),
    axes,
  );

  speed.addEventListener("change", () => player.setSpeed(Number(speed.value)));
  scrub.addEventListener("input", () => player.seekTime(Number(scrub.value)));
  scrub.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -100, PageUp: 100 }[event.key];
    if (steps === undefined) return;
    // A step here is one block; the slider's own step is a second.
    event.preventDefault();
    event.stopPropagation();
    player.step(steps);
  });

  function readout(): void {
    const { motion, row, time, done } = player;
    if (play.dataset["playing"] !== String(player.playing)) {
      play.dataset["playing"] = String(player.playing);
      play.textContent = player.playing ? "❙❙" : "▶";
      play.dataset["tTitle"] = play.dataset["tLabel"] = player.playing ? "player.pause" : "player.play";
      translateAll(root);
    }
    for (const each of [back, play, forward, scrub]) each.disabled = !motion?.rows;
    if (String(player.speed) !== speed.value) speed.value = String(player.speed);
    scrub.value = String(time);
    now.textContent = `${timeText(time)} / ${timeText(player.duration)}`;
    scrub.setAttribute("aria-valuetext", now.textContent);
    place.textContent = motion?.rows ? placeText(motion, row) : "";
    motion?.axes.forEach((_, axis) => {
      const value = motion.value(axis, row, done);
      values[axis]!.textContent = Number.isNaN(value) ? "—" : fixed(value, digitsOf(value, DIGITS));
    });
    motion?.switches.forEach((name, index) => {
      lights[index]!.dataset["on"] = String(motion.isOn(name, row));
    });
  }

  function placeText(motion: Motion, row: number): string {
    const { kinds, kind_names } = motion.blocks;
    const parts = [t("player.block", { block: motion.block(row), blocks: motion.block(motion.rows - 1) })];
    if (motion.lines[row]) parts.push(t("player.line", { line: motion.lines[row]! }));
    if (motion.courses[row]) parts.push(t(`player.on.${kind}`, { number: motion.courses[row]! }));
    parts.push(t(`player.kind.${kind_names[kinds[row]!]}`));
    return parts.join(" · ");
  }

  /** Builds the readouts for the program's axes and switches. */
  function build(motion: Motion | null): void {
    scrub.max = String(motion?.duration ?? 0);
    values.length = 0;
    lights.length = 0;
    axes.replaceChildren();
    lamps.replaceChildren();
    for (const axis of motion?.axes ?? []) {
      const value = h("output", { testid: `axis-${axis.name}` });
      const unit = h("span", {}, axis.revolute ? "°" : axis.unit);
      axes.append(h("div", {}, h("dt", {}, axis.name), h("dd", {}, value, unit)));
      values.push(value);
    }
    for (const name of motion?.switches ?? []) {
      const light = h("span", { testid: `switch-${name}`, t: `player.switch.${name}` });
      lamps.append(light);
      lights.push(light);
    }
  }

  function retranslate(): void {
    translateAll(root);
    ruler.show(shown);
    readout();
  }

  function load(made: Made | null): void {
    shown = made;
    if (made) kind = made.kind;
    const motion = made && motionOf(made);
    ruler.show(made);
    build(motion);
    player.load(motion);
  }

  player.onChange(readout);
  readout();
  return { clock: player, show: load, clear: () => load(null), retranslate };
};
