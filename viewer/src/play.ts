// The page of `carom play`: aim, tip and speed around the viewer's own page, which shows the table in a frame.
//
// Shots and the line of aim are computed by the server. A new run is loaded in a second frame and takes the place of the
// first when it is ready, so that nothing flashes. While the shown run is at its end the balls lie as the server knows them:
// then a sheet over the table takes the pointer and draws the aim.

import type { Hook } from "./main";
import type { Vec } from "./run";

interface Stroke {
  direction: number;
  speed: number;
  side: number;
  height: number;
  elevation: number;
  squirt: boolean;
}

interface State {
  /** The number of this state of the table. */
  state: number;
  balls: Record<string, [number, number]>;
  radius: number;
  shots: number;
  undo: boolean;
  words: string;
  /** Whether the balls lie at rest, and no shot is shown. */
  still: boolean;
  /** Whether the cue ball was put back after the shot that is shown. */
  back: boolean;
  aim?: Stroke | null;
}

interface Sight {
  path: [number, number][];
  hit: string | null;
  ghost: [number, number] | null;
  after: Record<string, [number, number][]>;
}

declare global {
  interface Window {
    /** For tests and for the console. */
    play: Record<string, unknown>;
  }
}

const CUE = "cue";
const MISCUE = 0.5; // radii: beyond it real tips slip
const FINE = 0.1;
const STEPS: Record<string, [keyof Stroke, number]> = {
  ArrowLeft: ["direction", Math.PI / 360],
  ArrowRight: ["direction", -Math.PI / 360],
  ArrowUp: ["speed", 0.2],
  ArrowDown: ["speed", -0.2],
  a: ["side", -0.05],
  d: ["side", 0.05],
  w: ["height", 0.05],
  s: ["height", -0.05],
  e: ["elevation", Math.PI / 60],
  q: ["elevation", -Math.PI / 60],
};
const LIMITS: Partial<Record<keyof Stroke, [number, number]>> = {
  speed: [0.1, 12],
  elevation: [0, (80 * Math.PI) / 180],
};

const byId = <T extends Element = HTMLElement>(id: string): T => document.getElementById(id) as unknown as T;

class Play {
  private aim: Stroke = { direction: 0, speed: 2, side: 0, height: 0, elevation: 0, squirt: false };
  private state!: State;
  private sight: Sight | undefined;
  private frame: HTMLIFrameElement | undefined;
  private preset: "fit" | "top" | "side" | "end" = "top";
  private looking = false;
  private busy = false;
  private wanted = false;
  private asking = false;
  private dragged: string | undefined;
  private readonly answers: number[] = [];
  /** What the sheet shows. */
  private drawn = "";
  private readonly sheet = byId<HTMLCanvasElement>("sheet");

  async start(): Promise<void> {
    this.controls();
    this.pointer();
    this.keys();
    await this.take(await ask<State>("state"), false);
    const loop = () => {
      requestAnimationFrame(loop);
      this.draw();
    };
    loop();
  }

  hook(): Record<string, unknown> {
    return {
      aim: () => ({ ...this.aim }),
      set: (aim: Partial<Stroke>) => this.change(aim),
      state: () => this.state,
      sight: () => this.sight,
      aiming: () => this.aiming,
      asking: () => this.asking,
      rate: () => this.rate(),
      pixel: (x: number, y: number) => this.viewer?.project([x, y, this.state.radius]),
      viewer: () => this.viewer,
    };
  }

  private get viewer(): Hook | undefined {
    return (this.frame?.contentWindow as Window | undefined)?.carom;
  }

  /** Whether the balls on the screen lie as the next shot finds them. */
  private get aiming(): boolean {
    const { viewer } = this;
    if (this.busy || !viewer?.state) return false;
    return !viewer.running() && viewer.left() === 0;
  }

  // --- shots ---------------------------------------------------------------------------------------------------------

  private async shoot(): Promise<void> {
    if (this.aiming) await this.act("shoot", this.aim, true);
  }

  /** Asks the server to do something, and shows what it answers. */
  private async act(what: string, given: object, play: boolean): Promise<void> {
    if (this.busy) return;
    this.busy = true;
    try {
      await this.take(await this.ask<State>(what, given), play);
    } catch (error) {
      await this.refused(error);
    } finally {
      this.busy = false;
    }
  }

  /** Asks about the table that is shown: should it no longer be like that, the server says so. */
  private ask<T>(what: string, given: object): Promise<T> {
    return ask<T>(what, { ...given, state: this.state.state });
  }

  /** Says what was in the way; where it is that another page changed the table, it is shown anew. */
  private async refused(error: unknown): Promise<void> {
    if (error instanceof Stale) await this.take(await ask<State>("state"), false);
    this.say(String((error as Error).message), true);
  }

  private async take(state: State, play: boolean): Promise<void> {
    this.state = state;
    if (state.aim) this.aim = { ...state.aim };
    this.sight = undefined;
    this.say(state.words);
    byId<HTMLButtonElement>("undo").disabled = !state.undo;
    byId("shots").textContent = String(state.shots);
    await this.load(play);
    this.change({});
  }

  private load(play: boolean): Promise<void> {
    const before = this.frame;
    const frame = document.createElement("iframe");
    frame.title = "The table";
    frame.src = `table?${Date.now()}`;
    return new Promise((done) => {
      frame.addEventListener("load", async () => {
        if (!ready(frame)) {
          frame.remove();
          await ask("table").catch((error: Error) => this.say(error.message, true));
          return done();
        }
        const { carom, document: page } = frame.contentWindow as Window;
        await carom.ready;
        // Of balls at rest there is nothing to play.
        const clock = page.querySelectorAll<HTMLElement>("#track, .group:has(#play), #clock, .speed");
        clock.forEach((part) => (part.hidden = this.state.still));
        for (const id of ["fit", "top", "side", "end"] as const) {
          page.getElementById(id)!.addEventListener("click", () => (this.preset = id));
        }
        page.getElementById("frame")!.hidden = true; // of a shot the time is enough, and the bar is one row
        const theme = (before?.contentWindow as Window | undefined)?.carom.state().theme ?? "dark"; // as this page is, or as it was chosen
        if (carom.state().theme !== theme) carom.theme();
        page.addEventListener("keydown", (event) => this.key(event));
        carom.view(this.preset, true);
        carom.show({ impacts: false });
        await carom.setTime(play ? 0 : Infinity);
        this.frame = frame;
        frame.classList.add("shown");
        before?.remove();
        if (play) carom.play(true, 1); // as it is, however short
        done();
      });
      this.sheet.before(frame);
    });
  }

  private async save(): Promise<void> {
    const text = await this.ask<{ name: string; text: string }>("save", this.aim).catch((error) => this.refused(error));
    if (!text) return;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text.text], { type: "application/toml" }));
    link.download = text.name;
    link.click();
    this.say(`Saved as ${text.name}; carom run ${text.name} plays it again.`);
  }

  // --- the aim -------------------------------------------------------------------------------------------------------

  private change(aim: Partial<Stroke>): void {
    const next = { ...this.aim, ...aim };
    for (const [name, [low, high]] of Object.entries(LIMITS) as [keyof Stroke, [number, number]][]) {
      (next[name] as number) = Math.min(Math.max(next[name] as number, low), high);
    }
    const off = Math.hypot(next.side, next.height);
    if (off > 0.95) [next.side, next.height] = [(0.95 * next.side) / off, (0.95 * next.height) / off];
    this.aim = next;
    this.show();
    this.wanted = true;
    void this.look();
  }

  /** Asks for the line of aim, one question at a time and always the newest. */
  private async look(): Promise<void> {
    if (this.asking) return;
    this.asking = true;
    try {
      while (this.wanted) {
        this.wanted = false;
        this.sight = await this.ask<Sight>("aim", this.aim);
        this.answers.push(performance.now());
        if (this.answers.length > 200) this.answers.shift();
      }
    } catch (error) {
      this.sight = undefined;
      const mine = this.busy; // then its own shot has changed the table, and asks anew
      this.busy = true;
      if (!mine) await this.refused(error);
      this.busy = mine;
    } finally {
      this.asking = false;
    }
    if (this.wanted) void this.look();
  }

  /** Lines of aim in the second before the newest. */
  private rate(): number {
    const last = this.answers[this.answers.length - 1];
    return this.answers.filter((time) => time > last - 1000).length;
  }

  private show(): void {
    const { aim } = this;
    const degrees = (angle: number) => ((angle * 180) / Math.PI).toFixed(1);
    byId<HTMLInputElement>("speed").value = String(aim.speed);
    byId("speed-is").textContent = `${aim.speed.toFixed(1)} m/s`;
    byId<HTMLInputElement>("elevation").value = degrees(aim.elevation);
    byId("elevation-is").textContent = `${degrees(aim.elevation)}°`;
    byId("direction-is").textContent = `${degrees(Math.atan2(Math.sin(aim.direction), Math.cos(aim.direction)))}°`;
    byId<HTMLInputElement>("squirt").checked = aim.squirt;
    const tip = byId("tip");
    tip.setAttribute("cx", String(aim.side));
    tip.setAttribute("cy", String(-aim.height));
    const off = Math.hypot(aim.side, aim.height);
    tip.classList.toggle("slips", off > MISCUE);
    byId("tip-is").textContent = `${aim.side.toFixed(2)}, ${aim.height.toFixed(2)}${off > MISCUE ? ": a real tip slips" : ""}`;
  }

  private say(words: string, wrong = false): void {
    const line = byId("words");
    line.textContent = words;
    line.classList.toggle("wrong", wrong);
  }

  // --- what the player does -------------------------------------------------------------------------------------------

  private controls(): void {
    const click = (id: string, action: () => void) => byId(id).addEventListener("click", action);
    click("shoot", () => void this.shoot());
    click("replay", () => this.replay());
    click("undo", () => void this.act("undo", {}, false));
    click("save", () => void this.save());
    click("look", () => this.turnLook());
    click("middle", () => this.change({ side: 0, height: 0 }));
    const slide = (id: "speed" | "elevation", scale: number) =>
      byId(id).addEventListener("input", (event) => this.change({ [id]: scale * Number((event.target as HTMLInputElement).value) }));
    slide("speed", 1);
    slide("elevation", Math.PI / 180);
    byId("squirt").addEventListener("change", (event) => this.change({ squirt: (event.target as HTMLInputElement).checked }));
    const ball = byId("ball");
    const touch = (event: PointerEvent) => {
      if (!(event.buttons & 1)) return;
      const { left, top, width, height } = ball.getBoundingClientRect();
      this.change({
        side: ((event.clientX - left) / width - 0.5) * 2.1,
        height: (0.5 - (event.clientY - top) / height) * 2.1,
      });
    };
    ball.addEventListener("pointerdown", touch);
    ball.addEventListener("pointermove", touch);
  }

  private replay(): void {
    void this.viewer?.setTime(0).then(() => this.viewer?.play());
  }

  private turnLook(): void {
    this.looking = !this.looking;
    byId("look").setAttribute("aria-pressed", String(this.looking));
  }

  private keys(): void {
    window.addEventListener("keydown", (event) => this.key(event));
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const step = STEPS[name];
    const actions: Record<string, () => void> = {
      " ": () => void this.shoot(),
      Enter: () => void this.shoot(),
      r: () => this.replay(),
      u: () => void this.act("undo", {}, false),
      c: () => this.turnLook(),
      x: () => this.change({ side: 0, height: 0, elevation: 0 }),
    };
    if (!step && !actions[name]) return;
    // Here these are the keys of the game, and neither of the viewer nor of a slider.
    event.preventDefault();
    event.stopImmediatePropagation();
    if (step) this.change({ [step[0]]: (this.aim[step[0]] as number) + step[1] * (event.shiftKey ? FINE : 1) });
    else actions[name]();
  }

  /** A drag aims at where the pointer is; from the cue ball, or with Shift from any ball, it moves that ball. */
  private pointer(): void {
    const { sheet } = this;
    const where = (event: PointerEvent): [number, number] | undefined => {
      const { left, top } = sheet.getBoundingClientRect();
      const at = this.viewer?.under(event.clientX - left, event.clientY - top, [0, 0, this.state.radius]);
      return at ? [at[0], at[1]] : undefined;
    };
    const aimAt = (at: [number, number]) => {
      const [x, y] = this.state.balls[CUE];
      if (Math.hypot(at[0] - x, at[1] - y) > this.state.radius) this.change({ direction: Math.atan2(at[1] - y, at[0] - x) });
    };
    sheet.addEventListener("pointerdown", (event) => {
      const at = where(event);
      if (!at || event.button !== 0) return;
      sheet.setPointerCapture(event.pointerId);
      const away = (name: string) => Math.hypot(...this.state.balls[name].map((c, k) => c - at[k]));
      const under = Object.keys(this.state.balls).find((name) => away(name) < 1.3 * this.state.radius);
      if (under === CUE || (under !== undefined && event.shiftKey)) this.dragged = under;
      else aimAt(at);
    });
    sheet.addEventListener("pointermove", (event) => {
      const at = where(event);
      if (!at || !(event.buttons & 1)) return;
      if (this.dragged) this.ghost = at;
      else aimAt(at);
    });
    sheet.addEventListener("pointerup", () => {
      const [name, at] = [this.dragged, this.ghost];
      this.dragged = this.ghost = undefined;
      if (name && at) void this.act("place", { ball: name, x: at[0], y: at[1] }, false);
    });
  }

  /** Where a ball that is being moved would lie. */
  private ghost: [number, number] | undefined;

  // --- the picture ---------------------------------------------------------------------------------------------------

  private draw(): void {
    const { sheet, viewer } = this;
    const aiming = this.aiming;
    sheet.classList.toggle("idle", !aiming || this.looking);
    document.body.classList.toggle("moving", !aiming);
    byId<HTMLButtonElement>("shoot").disabled = !aiming;
    const stage = this.frame?.contentDocument?.getElementById("stage");
    const [width, height] = [stage?.clientWidth ?? 0, stage?.clientHeight ?? 0];
    const sharp = window.devicePixelRatio;
    if (sheet.width !== Math.round(width * sharp) || sheet.height !== Math.round(height * sharp)) {
      [sheet.width, sheet.height] = [Math.round(width * sharp), Math.round(height * sharp)];
      [sheet.style.width, sheet.style.height] = [`${width}px`, `${height}px`];
    }
    // The sheet lies over the whole table: it is drawn anew only where something changed.
    const corner = ([x, y]: Vec) => viewer?.project?.([x, y, 0]);
    const { sight, ghost } = this;
    const now = JSON.stringify([aiming, width, height, sharp, corner([0, 0, 0]), corner([1, 1, 0]), this.aim, sight, ghost, this.state]);
    if (now === this.drawn) return;
    this.drawn = now;
    const pen = sheet.getContext("2d")!;
    pen.setTransform(sharp, 0, 0, sharp, 0, 0);
    pen.clearRect(0, 0, width, height);
    if (!aiming || !viewer) return;
    const { radius, balls } = this.state;
    const line = (points: [number, number][], colour: string, wide: number, dash: number[] = []) => {
      const pixels = points.map(([x, y]) => viewer.project([x, y, radius] as Vec)).filter((at) => at !== null);
      pen.beginPath();
      pixels.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      [pen.strokeStyle, pen.lineWidth] = [colour, wide];
      pen.setLineDash(dash);
      pen.stroke();
    };
    const disc = ([x, y]: [number, number]) => {
      const [at, side] = [[x, y], [x + radius, y]].map(([u, v]) => viewer.project([u, v, radius] as Vec));
      if (!at || !side) return;
      pen.beginPath();
      pen.arc(...at, Math.hypot(side[0] - at[0], side[1] - at[1]), 0, 2 * Math.PI);
      pen.fillStyle = "#f0e8d6";
      pen.fill();
    };
    const ring = ([x, y]: [number, number], colour: string) => {
      const turn = Array.from({ length: 33 }, (_, k) => (k * Math.PI) / 16);
      line(turn.map((t) => [x + radius * Math.cos(t), y + radius * Math.sin(t)]), colour, 1.5);
    };
    if (ghost) return ring(ghost, "#ffffff");
    if (this.state.back) disc(balls[CUE]);
    this.stick(line, balls[CUE]);
    if (!sight) return;
    line(sight.path, "rgb(255 255 255 / 0.85)", 1.5);
    for (const [name, way] of Object.entries(sight.after)) {
      line(way, name === CUE ? "rgb(255 255 255 / 0.85)" : "#ffd43b", 2, name === CUE ? [5, 4] : []);
    }
    if (sight.ghost) ring(sight.ghost, "#ffffff");
  }

  /** The cue, drawn back by its speed. */
  private stick(line: (points: [number, number][], colour: string, wide: number) => void, [x, y]: [number, number]): void {
    const { aim } = this;
    const { radius } = this.state;
    const [c, s] = [Math.cos(aim.direction), Math.sin(aim.direction)];
    const at = (along: number): [number, number] => [x - along * c + aim.side * radius * s, y - along * s - aim.side * radius * c];
    const tip = 1.4 * radius + 0.03 * aim.speed;
    line([at(tip), at(tip + 0.75)], "#c89a5b", 5);
    line([at(tip), at(tip + 0.02)], "#3f7fbf", 5);
  }
}

class Stale extends Error {}

/** Whether a frame has the viewer's page, and no refusal, which may not even be looked at. */
function ready(frame: HTMLIFrameElement): boolean {
  try {
    return Boolean((frame.contentWindow as Window).carom);
  } catch {
    return false;
  }
}

async function ask<T>(what: string, given?: unknown): Promise<T> {
  const options = given === undefined ? {} : { method: "POST", body: JSON.stringify(given) };
  const answer = await fetch(what, options);
  const found = (await answer.json()) as T & { error?: string };
  if (!answer.ok) throw new (answer.status === 409 ? Stale : Error)(found.error ?? answer.statusText);
  return found;
}

const game = new Play();
window.play = game.hook();
window.play.ready = game.start();
