// Joints and springs: rods, coils, rails and pins. A spring is drawn as long as it is; its turns stay.

import type { Run, Vec } from "./run";
import type { Sticks, Tint } from "./sticks";
import { add, basis, scale, unit } from "./vec";

export interface Link {
  name: string;
  kind: "fix" | "line" | "plane" | "lock" | "ball" | "rod" | "motion" | "spring";
  /** Bodies, -1 the ground. */
  a: number;
  b: number;
  /** Ends: of a ball in its own axes, relative to its centre; of the ground where it is. */
  from: Vec;
  to: Vec;
  /** Fixed directions: along a line, normal to a plane, locked. */
  axes: Vec[];
}

const METAL: Tint = [0.42, 0.45, 0.5];
const PIN: Tint = [0.85, 0.62, 0.08];
const TURNS = 9;
const STEPS = 10; // pieces of a turn
const MOST_COILS = 200; // more springs are drawn straight

export class Links {
  private readonly links: Link[];
  private readonly coils: boolean;
  readonly present: boolean;

  constructor(
    private readonly run: Run,
    private readonly size: number,
  ) {
    this.links = run.facts.links ?? [];
    this.present = this.links.length > 0;
    this.coils = this.links.filter((link) => link.kind === "spring").length <= MOST_COILS;
  }

  /** Rods, coils and rails among the balls; pins and axes on top of them. */
  draw(among: Sticks, onTop: Sticks): void {
    for (const link of this.links) {
      if ([link.a, link.b].some((body) => body >= 0 && !this.run.present(body))) continue;
      const from = this.end(link.a, link.from);
      const to = this.end(link.b, link.to);
      const r = this.radius(link);
      if (link.kind === "rod") this.rod(among, onTop, from, to, r);
      else if (link.kind === "spring") this.spring(among, onTop, from, to, r);
      else this.guide(link, among, onTop, from, to, r);
    }
  }

  private rod(among: Sticks, onTop: Sticks, from: Vec, to: Vec, r: number): void {
    among.rod(from, to, 0.12 * r, METAL);
    pin(onTop, from, 0.16 * r);
    pin(onTop, to, 0.16 * r);
  }

  private spring(among: Sticks, onTop: Sticks, from: Vec, to: Vec, r: number): void {
    const way = add(to, from, -1);
    const axis = unit(way);
    const [u, v] = basis(axis);
    const wire = 0.05 * r;
    pin(onTop, from, 0.12 * r);
    pin(onTop, to, 0.12 * r);
    if (!this.coils) {
      among.rod(from, to, 0.08 * r, METAL);
      return;
    }
    const total = TURNS * STEPS;
    let before = from;
    for (let i = 1; i <= total; i++) {
      const s = i / total;
      const angle = 2 * Math.PI * TURNS * s;
      // Straight for a piece at both ends.
      const wide = 0.38 * r * Math.min(1, 8 * Math.min(s, 1 - s));
      const on = add(from, way, s);
      const next = add(add(on, u, wide * Math.cos(angle)), v, wide * Math.sin(angle));
      among.rod(before, next, wire, METAL);
      before = next;
    }
  }

  private guide(link: Link, among: Sticks, onTop: Sticks, from: Vec, to: Vec, r: number): void {
    const reach = 3.2 * r;
    const rail = link.kind === "line" || link.kind === "motion";
    for (const axis of link.axes) {
      if (link.kind === "plane") {
        // A square frame in the plane in which the point moves.
        const [u, v] = basis(axis);
        const at = link.b < 0 ? to : from;
        const corners = [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([p, q]) => add(add(at, u, 1.6 * r * p), v, 1.6 * r * q));
        corners.forEach((corner, i) => among.rod(corner, corners[(i + 1) % 4], 0.06 * r, METAL));
      } else {
        // A rail stays where it is; a locked axis goes along with its ball.
        const at = rail ? to : from;
        const half = rail ? reach : 1.45 * r;
        (rail ? among : onTop).rod(add(at, axis, -half), add(at, axis, half), 0.06 * r, rail ? METAL : PIN);
      }
    }
    if (link.kind !== "lock") pin(onTop, from, 0.16 * r);
    // A fixed point: a small tripod under it, towards the ground.
    if (link.kind === "fix") {
      for (const [p, q] of [[1, 0], [-0.5, 0.87], [-0.5, -0.87]]) {
        const down = this.down();
        const [u, v] = basis(down);
        onTop.rod(to, add(add(add(to, down, 0.45 * r), u, 0.3 * r * p), v, 0.3 * r * q), 0.05 * r, PIN);
      }
    }
  }

  private down(): Vec {
    return unit(this.run.facts.gravity);
  }

  private radius(link: Link): number {
    const bodies = [link.a, link.b].filter((body) => body >= 0);
    return bodies.length ? Math.min(...bodies.map((body) => this.run.radius[body])) : this.size;
  }

  /** Where an end is now, relative to the run's origin. */
  private end(body: number, arm: Vec): Vec {
    if (body < 0) return add(arm, this.run.origin, -1);
    const { centre, attitude } = this.run;
    const [x, y, z, w] = attitude.subarray(4 * body, 4 * body + 4);
    const t = scale([y * arm[2] - z * arm[1], z * arm[0] - x * arm[2], x * arm[1] - y * arm[0]], 2);
    return [
      centre[4 * body] + arm[0] + w * t[0] + y * t[2] - z * t[1],
      centre[4 * body + 1] + arm[1] + w * t[1] + z * t[0] - x * t[2],
      centre[4 * body + 2] + arm[2] + w * t[2] + x * t[1] - y * t[0],
    ];
  }
}

/** A small bead: a rod as long as it is thick, in each of three directions. */
function pin(sticks: Sticks, at: Vec, r: number): void {
  for (let k = 0; k < 3; k++) {
    const half: Vec = [0, 0, 0];
    half[k] = 0.8 * r;
    sticks.rod(add(at, half, -1), add(at, half), 0.6 * r, PIN);
  }
}
