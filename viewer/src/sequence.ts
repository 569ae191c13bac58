// The impacts of the step shown, in their order: numbers over the contacts, and a list with pairs and impulses.

import { amount, byId, create, figure, shortened } from "./dom";
import { STATUS_WORDS, type Impacts } from "./happenings";
import type { Run } from "./run";
import type { Stage } from "./stage";

const MOST_ROWS = 12;
const MOST_BADGES = 60;

export class Sequence {
  private readonly host = byId("sequence");
  private readonly title = byId("sequence-title");
  private readonly rows = byId("sequence-rows");
  private readonly layer = byId("badges");
  private readonly badges: HTMLSpanElement[] = [];
  private shown = -1;

  constructor(
    private readonly run: Run,
    private readonly stage: Stage,
  ) {}

  /** `on`: the reader wants to see impacts. While they fly by only the time of the last is shown. */
  update(on: boolean, playing: boolean): void {
    this.place(on);
    const { impacts } = this.run;
    this.host.hidden = !on || !impacts;
    if (this.host.hidden || !impacts) return;
    this.host.classList.toggle("brief", playing);
    const [from, to] = impacts.latest(this.run.now);
    if (this.shown === to) return;
    this.shown = to;
    this.rows.closest("table")!.hidden = to === 0; // no headings of nothing
    if (to === 0) {
      this.title.textContent = "No impact yet";
      this.rows.replaceChildren();
      return;
    }
    const problems = impacts.problem.subarray(from, to).reduce((a, b) => Math.max(a, b), 0);
    this.title.textContent = `Impacts at ${+impacts.time[from].toPrecision(7)} s \u00b7 ${problems} in sequence`;
    this.rows.replaceChildren(...this.list(impacts, from, to));
  }

  /** Time of the next impact, or of the one before; undefined where there is none. */
  neighbour(by: 1 | -1): number | undefined {
    const { impacts } = this.run;
    if (!impacts) return undefined;
    const [from, to] = impacts.latest(this.run.now);
    if (by > 0) return to < impacts.count ? impacts.time[to] : undefined;
    // From between two impacts a step back goes to the one just passed.
    if (to > from && impacts.time[from] < this.run.now) return impacts.time[from];
    return from > 0 ? impacts.time[from - 1] : undefined;
  }

  private list(impacts: Impacts, from: number, to: number): HTMLElement[] {
    const found: HTMLElement[] = [];
    const name = (n: number) => shortened(this.run.nameOf(n), 20);
    let fastest = 0;
    for (let row = from; row < to; row++) fastest = Math.max(fastest, Math.abs(impacts.approach(row)), Math.abs(impacts.separation(row)));
    const step = Math.max(Math.min(1e-3, 1e-2 * fastest), 1e-6 * fastest);
    for (let row = from; row < Math.min(to, from + MOST_ROWS); row++) {
      const line = create("tr");
      const order = impacts.problem[row];
      const number = create("td", "", order > 0 ? String(order) : "\u2013");
      if (order === 0) number.title = "pushed by gravity or loads in the same step";
      const pair = create("td", "", `${name(impacts.first(row))} \u2013 ${name(impacts.second(row))}`);
      const word = STATUS_WORDS[impacts.status(row)];
      const state = create("td");
      state.append(create("i", `dot ${word}`), word);
      const impulse = create("td", "", amount(impacts.size(row), true));
      const speeds = create("td", "", `${figure(impacts.approach(row), step, fastest)} \u2192 ${figure(impacts.separation(row), step, fastest)}`);
      line.append(number, pair, state, impulse, speeds);
      found.push(line);
    }
    if (to - from > MOST_ROWS) {
      const line = create("tr");
      const cell = create("td", "fine", `and ${to - from - MOST_ROWS} more`);
      cell.colSpan = 5;
      line.append(cell);
      found.push(line);
    }
    return found;
  }

  private place(on: boolean): void {
    const taken: [number, number][] = [];
    const wanted = on ? this.stage.overlay.badges.slice(0, MOST_BADGES) : [];
    while (this.badges.length < wanted.length) this.badges.push(this.layer.appendChild(create("span")));
    this.badges.forEach((badge, i) => {
      const point = wanted[i] && this.stage.project(wanted[i].at);
      badge.hidden = !point;
      if (!point) return;
      // Contacts that lie close together have their numbers one under the other.
      for (let k = 0; k < 5 && taken.some(([x, y]) => Math.abs(x - point[0]) < 26 && Math.abs(y - point[1]) < 20); k++) point[1] += 20;
      taken.push(point);
      badge.textContent = wanted[i].text;
      badge.className = STATUS_WORDS[wanted[i].status];
      badge.style.transform = `translate(${point[0].toFixed(1)}px, ${point[1].toFixed(1)}px) translate(-50%, -50%)`;
    });
  }
}
