// The bar under the picture, and the keys.

import type { Preset } from "./camera";
import { SPEEDS, type Clock } from "./clock";
import { byId, create, decimals } from "./dom";
import type { Run } from "./run";

export interface Commands {
  view(preset: Preset): void;
  follow(): void;
  labels(): void;
  bodies(): void;
  theme(): void;
  deselect(): void;
  menu(): void;
  toggle(what: "velocities" | "contacts" | "impacts" | "through"): void;
  trails(): void;
  graphs(): void;
  picture(): void;
  /** To the next impact, or to the one before. */
  impact(by: 1 | -1): void;
  /** Turns and tilts the view by angles, and comes nearer by a factor. */
  orbit(turn: number, tilt: number, zoom: number): void;
}

const TURN = Math.PI / 36; // a key's worth
const ZOOM = 1.12;

export class Bar {
  private readonly play = byId<HTMLButtonElement>("play");
  private readonly begin = byId<HTMLButtonElement>("begin");
  private readonly scrub = byId<HTMLInputElement>("scrub");
  private readonly time = byId("time");
  private readonly frame = byId("frame");
  private readonly speed = byId<HTMLSelectElement>("speed");
  private readonly marks = byId<HTMLCanvasElement>("marks");
  private readonly help = byId<HTMLDialogElement>("help");
  private readonly digits: number;
  private begun = false;

  constructor(
    private readonly run: Run,
    private readonly clock: Clock,
    private readonly commands: Commands,
  ) {
    const span = run.end - run.start;
    // Readable as a moving number and exact to a frame.
    this.digits = Math.max(3, decimals(run.frames > 1 ? span / (run.frames - 1) : 1));
    this.scrub.min = String(run.start);
    this.scrub.max = String(span > 0 ? run.end : run.start + 1);
    for (const s of SPEEDS) this.speed.add(new Option(`${s}\u00d7`, String(s)));
    this.begin.hidden = run.frames < 2;
    for (const id of ["play", "back", "on", "loop", "scrub", "speed"]) {
      (byId(id) as HTMLButtonElement).disabled = run.frames < 2;
    }
    this.listen();
    new ResizeObserver(() => this.drawMarks()).observe(this.marks);
  }

  /** Shows the clock as it stands. */
  update(): void {
    const { run, clock } = this;
    this.play.classList.toggle("playing", clock.playing);
    this.play.setAttribute("aria-label", clock.playing ? "Pause" : "Play");
    this.begun ||= clock.playing || clock.time > run.start;
    this.begin.hidden = this.begun || run.frames < 2;
    byId("loop").setAttribute("aria-pressed", String(clock.loop));
    this.speed.value = String(clock.speed);
    this.scrub.value = String(clock.time);
    this.scrub.setAttribute("aria-valuetext", `${clock.time.toFixed(this.digits)} seconds`);
    this.time.textContent = `${clock.time.toFixed(this.digits)} s`;
    this.frame.textContent = `of ${+run.end.toPrecision(6)} s \u00b7 frame ${run.frame + 1} / ${run.frames}`;
  }

  /** Once someone has found their way, the large button is only in the way. */
  dismiss(): void {
    this.begun = true;
    this.begin.hidden = true;
  }

  press(id: string, on: boolean): void {
    byId(id).setAttribute("aria-pressed", String(on));
  }

  /** Impacts as ticks over the track, in the colour of the theme. */
  drawMarks(): void {
    const pen = this.marks.getContext("2d")!;
    const ratio = devicePixelRatio;
    const { clientWidth, clientHeight } = this.marks;
    this.marks.width = clientWidth * ratio;
    this.marks.height = clientHeight * ratio;
    pen.fillStyle = getComputedStyle(this.marks).getPropertyValue("--mark");
    const span = this.run.end - this.run.start || 1;
    const thumb = 8; // a range's thumb stops half its width from either end
    for (const mark of this.run.facts.marks) {
      const x = thumb + ((mark - this.run.start) / span) * (clientWidth - 2 * thumb);
      pen.fillRect(Math.round(x * ratio), 0, Math.max(1, Math.round(ratio)), this.marks.height);
    }
  }

  private listen(): void {
    const { clock, commands } = this;
    const click = (id: string, act: () => void) =>
      byId(id).addEventListener("click", (event) => {
        act();
        // After a click of the mouse the space bar should play again, not press the same button.
        if (event.detail > 0) (event.currentTarget as HTMLElement).blur();
      });
    click("play", () => clock.play());
    click("begin", () => clock.play());
    click("back", () => clock.step(-1));
    click("on", () => clock.step(1));
    click("loop", () => this.loop());
    for (const preset of ["fit", "top", "side", "end"] as const) click(preset, () => commands.view(preset));
    click("follow", () => commands.follow());
    click("tags", () => commands.labels());
    click("bodies", () => commands.bodies());
    click("theme", () => commands.theme());
    click("unselect", () => commands.deselect());
    click("what", () => commands.menu());
    click("plots", () => commands.graphs());
    click("picture", () => commands.picture());
    click("before", () => commands.impact(-1));
    click("after", () => commands.impact(1));
    click("keys", () => this.help.showModal());
    this.scrub.addEventListener("input", () => clock.seek(Number(this.scrub.value)));
    this.speed.addEventListener("change", () => {
      clock.speed = Number(this.speed.value);
      this.speed.blur();
    });
    addEventListener("keydown", (event) => this.key(event));
  }

  private loop(): void {
    this.clock.loop = !this.clock.loop;
    this.update();
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey || this.help.open) return;
    const target = event.target as HTMLElement;
    if (target.closest("input[type=search], select")) return;
    // A slider keeps its own keys, and so does a box that is ticked with the space bar.
    if (target.closest("#show input") && !/^[a-z?]$/i.test(event.key)) return;
    // A focused button keeps what the space bar does to buttons.
    if (event.key === " " && target.closest("button")) return;
    const { clock, commands } = this;
    const stride = event.shiftKey ? 10 : 1;
    const act: Record<string, () => void> = {
      " ": () => clock.play(),
      ArrowLeft: () => clock.step(-stride),
      ArrowRight: () => clock.step(stride),
      Home: () => clock.seek(this.run.start),
      End: () => clock.seek(this.run.end),
      "+": () => clock.faster(1),
      "=": () => clock.faster(1),
      "-": () => clock.faster(-1),
      "1": () => commands.view("fit"),
      "2": () => commands.view("top"),
      "3": () => commands.view("side"),
      "4": () => commands.view("end"),
      a: () => commands.orbit(-TURN, 0, 1),
      d: () => commands.orbit(TURN, 0, 1),
      w: () => commands.orbit(0, TURN, 1),
      s: () => commands.orbit(0, -TURN, 1),
      e: () => commands.orbit(0, 0, ZOOM),
      q: () => commands.orbit(0, 0, 1 / ZOOM),
      v: () => commands.toggle("velocities"),
      c: () => commands.toggle("contacts"),
      i: () => commands.toggle("impacts"),
      x: () => commands.toggle("through"),
      r: () => commands.trails(),
      m: () => commands.menu(),
      g: () => commands.graphs(),
      p: () => commands.picture(),
      n: () => commands.impact(event.shiftKey ? -1 : 1),
      f: () => commands.follow(),
      l: () => commands.labels(),
      b: () => commands.bodies(),
      t: () => commands.theme(),
      o: () => this.loop(),
      Escape: () => commands.deselect(),
      "?": () => this.help.showModal(),
    };
    const found = act[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!found) return;
    event.preventDefault();
    found();
  }
}

/** Says in words why there is no picture. */
export function fail(message: string): void {
  const place = byId("failure");
  place.textContent = message;
  place.hidden = false;
  byId("begin").hidden = true;
}

export function showNotes(notes: string[]): void {
  const place = byId("notes");
  place.hidden = notes.length === 0;
  place.replaceChildren(...notes.map((note) => create("span", "", `${note} `)));
}
