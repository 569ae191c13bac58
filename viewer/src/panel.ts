// The list of bodies, the card of the selected one, and the labels that float over the balls.

import { amount, byId, create, figure, shortened } from "./dom";
import type { Look } from "./palette";
import type { Run, Vec } from "./run";
import { greatest } from "./scale";
import type { Stage } from "./stage";

const MOST_LISTED = 300; // rows; a larger run is searched
const LISTED = 24; // characters of a name in the list
const MOST_LABELLED = 80; // labels at once: the nearest ones

export class Panel {
  private readonly panel = byId("panel");
  private readonly card = byId("card");
  private readonly list = byId("list");
  private readonly find = byId<HTMLInputElement>("find");
  private readonly cells = new Map<string, HTMLElement>();
  /** Of each axis the smallest change that is shown, and the largest number of the run. */
  private readonly scale: Record<"position" | "velocity" | "spin", [step: number, large: number][]>;

  constructor(
    private readonly run: Run,
    private readonly looks: Look[],
    private readonly choose: (body: number) => void,
  ) {
    const { box: [low, high], arrays } = run.facts;
    const usual = Math.min(...run.radius.slice(0, 1000)) / 50;
    const rates = (usual: number, large: number) =>
      Array<[number, number]>(3).fill([Math.max(Math.min(usual, 1e-2 * large), 1e-5 * large), large]);
    this.scale = {
      // Where all moves by less than a ball, digits go by how far it moves.
      position: low.map((l, k) => {
        const step = Math.min(usual, 1e-3 * (high[k] - l) || usual);
        return [Math.max(step, arrays.position.step!), Math.max(Math.abs(l), Math.abs(high[k]))];
      }),
      velocity: rates(1e-4, greatest(run, (n, frame) => run.velocityOf(n, frame))),
      spin: rates(1e-3, greatest(run, (n, frame) => run.spinOf(n, frame))),
    };
    this.find.hidden = run.count <= 20;
    this.find.addEventListener("input", () => this.fill());
    this.fill();
    this.rows();
  }

  show(on: boolean): void {
    this.panel.hidden = !on;
  }

  /** Numbers of the selected body at the time shown; -1 for none. */
  update(selected: number): void {
    this.card.hidden = selected < 0;
    if (selected < 0 || this.panel.hidden) return;
    const { run } = this;
    this.card.querySelector("h2")!.textContent = run.names[selected];
    (this.card.querySelector(".chip") as HTMLElement).style.background = this.looks[selected].css;
    const put = (name: keyof typeof this.scale, values: Vec, extra = "") => {
      const length = Math.hypot(...values);
      const scale = this.scale[name];
      values.forEach((v, k) => (this.cells.get(name + "xyz"[k])!.textContent = figure(v, ...scale[k])));
      const total = this.cells.get(name);
      if (total) total.textContent = figure(length, ...scale[0]) + extra;
    };
    put("position", run.where(selected));
    put("velocity", run.velocityOf(selected), " m/s");
    put("spin", run.spinOf(selected), " rad/s");
    if (!run.present(selected)) {
      this.card.querySelector(".fine")!.textContent = "not there at this time";
      return;
    }
    const turns = Math.hypot(...run.spinOf(selected)) / (2 * Math.PI);
    this.card.querySelector(".fine")!.textContent =
      `radius ${+run.radius[selected].toPrecision(5)} m \u00b7 ${amount(turns, true)} turns a second` +
      (run.hasRates ? "" : " \u00b7 rates are differences between frames");
  }

  mark(selected: number): void {
    for (const row of this.list.querySelectorAll("button")) {
      row.setAttribute("aria-pressed", String(Number(row.dataset.body) === selected));
    }
  }

  private rows(): void {
    const body = this.card.querySelector("tbody")!;
    for (const [name, title, unit] of [
      ["position", "Position", "m"],
      ["velocity", "Velocity", ""],
      ["spin", "Spin", ""],
    ]) {
      const head = create("tr", "head");
      const total = create("td", "", unit);
      head.append(create("th", "", title), total);
      if (!unit) this.cells.set(name, total);
      const row = create("tr");
      const all = create("td");
      all.colSpan = 2;
      const table = create("div", "triple");
      for (const axis of "xyz") {
        const cell = create("b");
        this.cells.set(name + axis, cell);
        const box = create("span", "", "");
        box.append(create("i", "", axis), cell);
        table.append(box);
      }
      all.append(table);
      row.append(all);
      body.append(head, row);
    }
  }

  private fill(): void {
    const wanted = this.find.value.trim().toLowerCase();
    const found: number[] = [];
    for (let n = 0; n < this.run.count && found.length <= MOST_LISTED; n++) {
      if (this.run.names[n].toLowerCase().includes(wanted)) found.push(n);
    }
    const rows = found.slice(0, MOST_LISTED).map((n) => {
      const button = create("button");
      button.type = "button";
      button.dataset.body = String(n);
      const chip = create("i", "chip");
      chip.style.background = this.looks[n].css;
      button.append(chip, create("span", "", shortened(this.run.names[n], LISTED)));
      button.title = this.run.names[n];
      button.addEventListener("click", () => this.choose(n));
      const item = create("li");
      item.append(button);
      return item;
    });
    if (found.length > MOST_LISTED) rows.push(create("li", "fine", `more than ${MOST_LISTED}: type to narrow`));
    if (found.length === 0) rows.push(create("li", "fine", "no such body"));
    this.list.replaceChildren(...rows);
  }
}

export class Labels {
  private readonly host = byId("labels");
  private readonly tags: HTMLSpanElement[] = [];
  on = false;
  private readonly taken: [x: number, y: number, half: number][] = [];

  constructor(
    private readonly run: Run,
    private readonly stage: Stage,
  ) {}

  update(selected: number): void {
    const wanted = this.on ? this.nearest().filter((n) => n !== selected) : [];
    if (selected >= 0) wanted.unshift(selected);
    this.taken.length = 0;
    while (this.tags.length < wanted.length) this.tags.push(this.host.appendChild(create("span")));
    this.tags.forEach((tag, i) => {
      const n = wanted[i];
      tag.hidden = n === undefined || !this.place(tag, n);
      if (!tag.hidden) tag.classList.toggle("chosen", n === selected);
    });
  }

  /** False where the body is out of view, or a nearer one's label is in the way. */
  private place(tag: HTMLElement, n: number): boolean {
    if (!this.run.present(n)) return false;
    const { centre } = this.run;
    const { up } = this.stage.world;
    const at = [0, 1, 2].map((k) => centre[4 * n + k] + 1.25 * centre[4 * n + 3] * up[k]) as Vec;
    const point = this.stage.project(at);
    if (!point) return false;
    const name = shortened(this.run.names[n]);
    const [x, y] = point;
    const half = 4 * name.length + 8; // near enough, without asking the browser to lay out
    if (this.taken.some(([u, v, h]) => Math.abs(x - u) < half + h && Math.abs(y - v) < 20)) return false;
    this.taken.push([x, y, half]);
    if (tag.textContent !== name) tag.textContent = name;
    tag.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -110%)`;
    return true;
  }

  private nearest(): number[] {
    const all = Array.from({ length: this.run.count }, (_, n) => n);
    const eye = this.stage.eye.camera.position;
    const { centre } = this.run;
    const away = all.map((n) => Math.hypot(centre[4 * n] - eye.x, centre[4 * n + 1] - eye.y, centre[4 * n + 2] - eye.z));
    return all.sort((a, b) => away[a] - away[b]).slice(0, MOST_LABELLED);
  }
}
