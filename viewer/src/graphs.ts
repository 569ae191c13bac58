// The graphs under the picture: energies, and the motion of the selected ball or of all.

import { byId, create } from "./dom";
import { Graph, type Series } from "./graph";
import type { Look } from "./palette";
import type { Run, Vec } from "./run";

const MOST_LINES = 16; // more balls are summed up
const MOST_SAMPLES = 2_000_000; // bodies times frames read for a summary
const MOST_POINTS = 6000;
const AXES = ["#d1495b", "#2e9e5b", "#2a7fd4"];

type Quantity = "velocity" | "spin" | "position";
const UNITS: Record<Quantity, string> = { velocity: "m/s", spin: "rad/s", position: "m" };
const WORDS: Record<Quantity, string> = { velocity: "Velocity", spin: "Spin", position: "Position" };

export class Graphs {
  private readonly host = byId("graphs");
  private readonly energy: Graph;
  private readonly motion: Graph;
  private readonly choice = create("select");
  private quantity: Quantity = "velocity";
  private drawn: string | undefined;
  on = false;

  constructor(
    private readonly run: Run,
    private readonly looks: Look[],
    seek: (time: number) => void,
    private readonly changed: () => void,
  ) {
    this.energy = new Graph(run.start, run.end, seek);
    this.motion = new Graph(run.start, run.end, seek);
    for (const quantity of Object.keys(WORDS) as Quantity[]) this.choice.add(new Option(WORDS[quantity], quantity));
    this.choice.setAttribute("aria-label", "What to plot");
    this.choice.addEventListener("change", () => {
      this.quantity = this.choice.value as Quantity;
      this.choice.blur();
      this.changed();
    });
    if (run.energies) this.host.append(this.energy.element);
    this.host.append(this.motion.element);
    new ResizeObserver(() => this.refresh()).observe(this.host);
  }

  show(on: boolean): void {
    this.on = on;
    this.host.hidden = !on;
    if (on && this.drawn === undefined) this.energies();
  }

  refresh(): void {
    this.energy.refresh();
    this.motion.refresh();
    if (this.on) this.changed();
  }

  update(selected: number): void {
    if (!this.on) return;
    const wanted = `${selected} ${this.quantity}`;
    if (this.drawn !== wanted) {
      this.motion.show(this.choice, UNITS[this.quantity], selected >= 0 ? this.ofBody(selected) : this.ofAll(), this.noise());
      this.drawn = wanted;
    }
    if (this.run.energies) this.energy.cursor(this.run.now);
    this.motion.cursor(this.run.now);
  }

  private energies(): void {
    const { energies } = this.run;
    if (!energies) return;
    const { time, kinetic, potential } = energies;
    // Only differences of a potential mean anything: it is shown above its least value.
    const least = potential.reduce((a, b) => Math.min(a, b), Infinity);
    const above = potential.map((v) => v - least);
    this.energy.show(create("h2", "", "Energy"), "J", [
      { name: "total", colour: "--ink", time, value: above.map((v, i) => v + kinetic[i]) },
      { name: "kinetic", colour: "#f06a00", time, value: kinetic },
      { name: "potential", colour: "#1f8fe0", time, value: above, dashed: true },
    ]);
  }

  /** What the rounding of the page's data may feign. */
  private noise(): number {
    const { arrays } = this.run.facts;
    if (this.quantity === "velocity") return 50 * (arrays.velocity?.step ?? 0);
    if (this.quantity === "spin") return 50 * (arrays.angular_velocity?.step ?? 0);
    return 50 * arrays.position.step!;
  }

  private frames(bodies: number): number[] {
    const most = Math.max(50, Math.min(MOST_POINTS, Math.floor(MOST_SAMPLES / bodies)));
    const stride = Math.max(1, Math.ceil(this.run.frames / most));
    const frames = [];
    for (let f = 0; f < this.run.frames - 1; f += stride) frames.push(f);
    return [...frames, this.run.frames - 1];
  }

  private vector(n: number, frame: number): Vec {
    const { run } = this;
    if (!run.present(n, frame)) return [NaN, NaN, NaN];
    if (this.quantity === "velocity") return run.velocityOf(n, frame);
    if (this.quantity === "spin") return run.spinOf(n, frame);
    const at: Vec = [0, 0, 0];
    run.centreAt(frame, n, at);
    return at.map((c, k) => c + run.origin[k]) as Vec;
  }

  private ofBody(n: number): Series[] {
    const frames = this.frames(1);
    const time = frames.map((f) => this.run.time[f]);
    const rows = frames.map((f) => this.vector(n, f));
    const lines: Series[] = [0, 1, 2].map((k) => ({ name: "xyz"[k], colour: AXES[k], time, value: rows.map((v) => v[k]) }));
    if (this.quantity === "position") return lines;
    return [{ name: this.run.names[n], colour: "--ink", time, value: rows.map((v) => Math.hypot(...v)) }, ...lines];
  }

  /** Sizes: of every ball where there are few, otherwise the greatest and the root mean square. */
  private ofAll(): Series[] {
    const { run } = this;
    const frames = this.frames(run.count);
    const time = frames.map((f) => run.time[f]);
    const up = run.facts.gravity.map((g) => -g / (Math.hypot(...run.facts.gravity) || 1));
    // Of positions the height says most.
    const size = (v: Vec) => (this.quantity === "position" ? v[0] * up[0] + v[1] * up[1] + v[2] * up[2] : Math.hypot(...v));
    if (run.count <= MOST_LINES) {
      return run.names.map((name, n) => ({ name, colour: this.looks[n].css, time, value: frames.map((f) => size(this.vector(n, f))) }));
    }
    const greatest = new Float64Array(frames.length).fill(NaN);
    const mean = new Float64Array(frames.length);
    frames.forEach((f, i) => {
      let [sum, count] = [0, 0];
      for (let n = 0; n < run.count; n++) {
        const s = size(this.vector(n, f));
        if (Number.isNaN(s)) continue;
        if (!(s <= greatest[i])) greatest[i] = s;
        sum += this.quantity === "position" ? s : s * s;
        count++;
      }
      mean[i] = this.quantity === "position" ? sum / count : Math.sqrt(sum / count);
    });
    const words = this.quantity === "position" ? ["highest", "mean height"] : ["greatest", "root mean square"];
    return [
      { name: words[0], colour: "#f06a00", time, value: greatest },
      { name: words[1], colour: "--ink", time, value: mean },
    ];
  }
}
