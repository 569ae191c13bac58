// Reads the page's data, puts the parts together and runs the loop: sample, draw, wait for a change.

import { Bar, fail, showNotes } from "./bar";
import { Clock } from "./clock";
import type { Preset } from "./camera";
import { byId, decimals } from "./dom";
import { Graphs } from "./graphs";
import type { Shown } from "./overlay";
import { Labels, Panel } from "./panel";
import { Run, type Vec } from "./run";
import { Sequence } from "./sequence";
import { Show } from "./show";
import { save, snapshot } from "./snapshot";
import { Stage } from "./stage";
import { Theme } from "./theme";
import { add } from "./vec";

/** For tests and for the console. Times are the run's own, in seconds. */
export interface Hook {
  /** Settles when the first picture is drawn, and fails with the reason if there will be none. */
  ready: Promise<void>;
  readonly frame: number;
  setTime(time: number): Promise<void>;
  play(on?: boolean, speed?: number): void;
  select(body: number | string): void;
  view(preset: Preset, atOnce?: boolean): void;
  follow(on?: boolean): void;
  theme(): void;
  show(what: Partial<Shown>): void;
  graphs(on?: boolean): void;
  /** The picture as a PNG, as a data URL. */
  picture(): string;
  state(): Record<string, unknown>;
  running(): boolean;
  /** Time to the end of the run. */
  left(): number;
  /** CSS pixels of a point of the scene; null behind the eye. */
  project(at: Vec): [number, number] | null;
  /** The point under a pixel, in the level plane through another point of the scene. */
  under(x: number, y: number, at: Vec): Vec | null;
}

declare global {
  interface Window {
    carom: Hook;
  }
}

const FLASH_S = 0.45; // on the clock on the wall

class App {
  private readonly clock: Clock;
  private readonly stage: Stage;
  private readonly bar: Bar;
  private readonly panel: Panel;
  private readonly labels: Labels;
  private readonly theme: Theme;
  private readonly show: Show;
  private readonly graphs: Graphs;
  private readonly sequence: Sequence;
  private selected = -1;
  private listed = false;
  private before: number | undefined;
  private pictures = 0;
  /** Milliseconds a picture takes here, without the drawing itself, which is done elsewhere; a running mean. */
  private work = 0;
  private waiting: (() => void)[] = [];

  constructor(private readonly run: Run) {
    const touch = () => (this.stage.dirty = true);
    this.stage = new Stage(run, byId("stage"));
    this.clock = new Clock(run, () => touch());
    this.panel = new Panel(run, this.stage.looks, (body) => this.select(body));
    this.labels = new Labels(run, this.stage);
    this.sequence = new Sequence(run, this.stage);
    this.show = new Show(run, this.stage.overlay, touch);
    this.graphs = new Graphs(run, this.stage.looks, (time) => this.seek(time), touch);
    this.bar = new Bar(run, this.clock, {
      view: (preset) => this.view(preset),
      follow: () => this.follow(),
      labels: () => this.toggleLabels(),
      bodies: () => this.list(!this.listed),
      theme: () => this.theme.toggle(),
      deselect: () => this.select(-1),
      menu: () => this.menu(!this.show.open),
      toggle: (name) => this.show.toggle(name),
      trails: () => this.show.nextTrails(),
      graphs: () => this.plot(!this.graphs.on),
      picture: () => this.save(),
      impact: (by) => this.impact(by),
      orbit: (turn, tilt, zoom) => this.stage.eye.nudge(turn, tilt, zoom),
    });
    this.theme = new Theme((shades) => {
      this.stage.paint(shades);
      this.bar.drawMarks();
      this.graphs.refresh();
    });
    this.theme.apply();
    showNotes(run.facts.notes);
    this.pointer();
    this.frame(performance.now());
  }

  hook(): Omit<Hook, "ready"> {
    const app = this;
    return {
      get frame() {
        return app.run.frame;
      },
      setTime: (time) => {
        this.clock.play(false);
        this.clock.seek(time);
        return new Promise((done) => this.waiting.push(done));
      },
      play: (on = true, speed = this.clock.speed) => {
        this.clock.speed = speed;
        this.clock.play(on);
      },
      select: (body) => this.select(typeof body === "string" ? this.run.names.indexOf(body) : body),
      view: (preset, atOnce) => this.view(preset, atOnce),
      follow: (on) => this.follow(on),
      theme: () => this.theme.toggle(),
      show: (what) => {
        Object.assign(this.stage.overlay.shown, what);
        this.stage.dirty = true;
      },
      graphs: (on = true) => this.plot(on),
      picture: () => this.snapshot().toDataURL("image/png"),
      state: () => this.state(),
      running: () => this.clock.playing,
      left: () => this.run.end - this.run.now,
      project: (at) => this.stage.project(add(at, this.run.origin, -1)) ?? null,
      under: (x, y, at) => {
        const found = this.stage.under(x, y, add(at, this.run.origin, -1));
        return found ? add(found, this.run.origin) : null;
      },
    };
  }

  private state(): Record<string, unknown> {
    const { run, clock, stage } = this;
    const bodies = Array.from({ length: Math.min(run.count, 1000) }, (_, n) => n);
    return {
      time: run.now,
      frame: run.frame,
      frames: run.frames,
      start: run.start,
      end: run.end,
      count: run.count,
      names: run.names,
      playing: clock.playing,
      loop: clock.loop,
      speed: clock.speed,
      selected: this.selected,
      followed: stage.eye.followed,
      theme: this.theme.name,
      table: stage.world.table,
      shown: { ...stage.overlay.shown },
      largest: { ...stage.overlay.largest },
      badges: stage.overlay.badges.map(({ text, status, at }) => ({ text, status, at: at.map((c, k) => c + run.origin[k]) })),
      graphs: this.graphs.on,
      pictures: this.pictures,
      work: this.work,
      sharpness: stage.sharpness,
      eye: stage.eye.camera.position.toArray().map((c, k) => c + run.origin[k]),
      present: bodies.map((n) => run.present(n)),
      walls: run.walls.map((wall) => ({
        name: wall.name,
        point: wall.pose === undefined ? wall.point : [0, 1, 2].map((k) => run.poses!.point[3 * wall.pose! + k] + run.origin[k]),
        turn: wall.pose === undefined ? [1, 0, 0, 0] : [3, 0, 1, 2].map((k) => run.poses!.turn[4 * wall.pose! + k]),
      })),
      drawn: [Math.min, Math.max].map((f) => [0, 1, 2].map((k) => f(...bodies.map((n) => run.centre[4 * n + k] + run.origin[k])))),
      positions: bodies.map((n) => run.where(n)),
      centres: bodies.map((n) => [0, 1, 2].map((k) => run.centre[4 * n + k] + run.origin[k])),
      box: run.box,
      orientations: bodies.map((n) => [3, 0, 1, 2].map((k) => run.attitude[4 * n + k])), // w first, as in Python
      screen: bodies.map((n) => stage.project([run.centre[4 * n], run.centre[4 * n + 1], run.centre[4 * n + 2]]) ?? null),
    };
  }

  /** Once per refresh of the screen; does nothing unless something moves. */
  private readonly frame = (now: number): void => {
    requestAnimationFrame(this.frame);
    const { clock, stage, run } = this;
    if (clock.playing && this.before !== undefined) {
      const wall = (now - this.before) / 1000;
      // A tab that slept goes on where it was.
      clock.advance(Math.min(wall, 0.25));
      stage.pace(wall);
    }
    const moving = clock.playing;
    this.before = moving ? now : undefined;
    if (!moving && !stage.dirty) return;
    const begun = performance.now();
    run.sample(clock.time);
    if (stage.draw(moving, this.hold())) stage.dirty = true;
    this.pictures++;
    this.bar.update();
    this.labels.update(this.selected);
    this.panel.update(this.selected);
    this.sequence.update(stage.overlay.shown.impacts, clock.playing);
    this.show.update();
    this.graphs.update(this.selected);
    this.work = 0.9 * this.work + 0.1 * (performance.now() - begun);
    for (const done of this.waiting.splice(0)) done();
  };

  private select(body: number): void {
    this.selected = body >= 0 && body < this.run.count ? body : -1;
    this.stage.select(this.selected);
    if (this.selected >= 0) this.bar.dismiss();
    this.panel.mark(this.selected);
    if (this.selected >= 0) this.list(true);
    else this.follow(false);
    if (this.stage.eye.followed >= 0) this.follow(true);
  }

  /** With nothing selected, follows the fastest: that is what happens. */
  private follow(on = this.stage.eye.followed < 0): void {
    if (on && this.selected < 0) {
      const speeds = this.run.names.map((_, n) => Math.hypot(...this.run.velocityOf(n)));
      this.stage.eye.followed = -1;
      this.select(speeds.indexOf(Math.max(...speeds)));
    }
    this.stage.eye.follow(on ? this.selected : -1);
    this.bar.press("follow", this.stage.eye.followed >= 0);
    this.stage.dirty = true;
  }

  /** How long an impact flashes, in the run's own time: long enough to be seen, and never shorter than a frame. */
  private hold(): number {
    const { run, clock } = this;
    const frame = (run.end - run.start) / Math.max(1, run.frames - 1);
    return Math.max(FLASH_S * clock.speed, 1.01 * frame);
  }

  private seek(time: number): void {
    this.clock.play(false);
    this.clock.seek(time);
  }

  private impact(by: 1 | -1): void {
    const time = this.sequence.neighbour(by);
    if (time === undefined) return;
    this.show.set("impacts", true);
    this.seek(time);
  }

  private menu(on: boolean): void {
    this.show.show(on);
    this.bar.press("what", on);
  }

  private plot(on: boolean): void {
    this.graphs.show(on);
    this.bar.press("plots", on);
    this.stage.dirty = true;
  }

  private digits(): number {
    const { run } = this;
    return Math.max(3, decimals(run.frames > 1 ? (run.end - run.start) / (run.frames - 1) : 1));
  }

  private snapshot(): HTMLCanvasElement {
    return snapshot(this.run, this.stage, this.digits());
  }

  private save(): void {
    save(this.snapshot(), this.run.facts.title, this.run.now.toFixed(this.digits()));
  }

  private view(preset: Preset, atOnce = false): void {
    this.stage.eye.go(preset, atOnce);
    this.bar.press("follow", false);
  }

  private toggleLabels(): void {
    this.labels.on = !this.labels.on;
    this.bar.press("tags", this.labels.on);
    this.stage.dirty = true;
  }

  private list(on: boolean): void {
    this.listed = on;
    this.panel.show(on);
    this.bar.press("bodies", on);
    this.stage.dirty = true;
  }

  /** A click that was not a drag selects; a double click follows. */
  private pointer(): void {
    const { canvas } = this.stage;
    let down: [number, number] | undefined;
    canvas.addEventListener("pointerdown", (event) => {
      down = event.isPrimary && event.button === 0 ? [event.clientX, event.clientY] : undefined;
      this.bar.dismiss();
    });
    canvas.addEventListener("dblclick", () => {
      if (this.selected >= 0) this.follow(true);
    });
    canvas.addEventListener("pointerup", (event) => {
      if (!down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 5) return;
      const { left, top } = canvas.getBoundingClientRect();
      this.select(this.stage.pick(event.clientX - left, event.clientY - top));
    });
  }
}

async function start(): Promise<Omit<Hook, "ready">> {
  if (typeof DecompressionStream === "undefined") throw new Error("This browser is too old for this page: it needs one from 2023 or later.");
  if (!document.createElement("canvas").getContext("webgl2")) {
    throw new Error("This page needs WebGL 2, which this browser does not offer or has switched off.");
  }
  const motion = byId("carom-motion");
  const run = await Run.read(byId("carom-facts").textContent!, motion.textContent!);
  motion.remove(); // megabytes that are no longer needed
  return new App(run).hook();
}

const ready = start().then((hook) => {
  // Descriptors, not values: `frame` is read live.
  Object.defineProperties(window.carom, Object.getOwnPropertyDescriptors(hook));
});
window.carom = { ready } as Hook;
ready.catch((error: unknown) => fail(error instanceof Error ? error.message : String(error)));
