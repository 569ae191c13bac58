// What is drawn besides bodies and walls: trails, arrows of velocities, forces and impulses, flashes, joints and springs.
// Contacts lie inside and between the balls, so arrows and flashes are drawn over everything, sorted among themselves.

import { Group, Scene, type IUniform } from "three";
import { Flashes, MOST_FLASHES } from "./flashes";
import { touch, type Pairs, type Status } from "./happenings";
import { Links } from "./links";
import { MOST_NUMBERED, linear, type Look } from "./palette";
import { edges, shiftOf } from "./periodic";
import type { Run, Vec } from "./run";
import { greatest } from "./scale";
import { Sticks, type Tint } from "./sticks";
import { add, norm } from "./vec";
import type { World } from "./world";
import { Trails, type TrailLength } from "./trails";

/** Of Okabe and Ito, told apart by all eyes; css in viewer.css has the same for the key. */
const COLOURS = { open: "#8d949e", stick: "#1f8fe0", slip: "#f06a00", velocity: "#d4459b" };
const TINTS = [COLOURS.open, COLOURS.stick, COLOURS.slip].map(linear);
const SCREEN = [COLOURS.open, COLOURS.stick, COLOURS.slip].map((css) => linear(css).map((c) => Math.sqrt(c)) as Tint);
const VELOCITY = linear(COLOURS.velocity);
/** Edges of a periodic box. */
const EDGE: Tint = [0.32, 0.38, 0.46];

const LENGTH = 7; // radii: of the arrow of the reference force or impulse
const LONGEST = 3; // times the reference

/** What the reader wants to see. */
export interface Shown {
  trails: TrailLength;
  velocities: boolean;
  contacts: boolean;
  impacts: boolean;
  links: boolean;
  /** Balls nearly transparent. */
  through: boolean;
  /** Factor on the length of all arrows. */
  scale: number;
}

/** The largest of what is drawn now, for the key; undefined where nothing is. */
export interface Largest {
  velocity?: number;
  contact?: number;
  impact?: number;
}

export interface Badge {
  at: Vec;
  text: string;
  status: Status;
}

export class Overlay {
  readonly among = new Group();
  readonly onTop = new Scene();
  readonly shown: Shown;
  readonly links: Links;
  largest: Largest = {};
  /** Places in the sequence, at the contacts of the impacts that flash. */
  badges: Badge[] = [];
  /** Whether some arrows or bars are not drawn in their full size. */
  cut = false;
  private readonly trails: Trails;
  private readonly flashes: Flashes;
  private readonly arrows: Sticks;
  private readonly rods: Sticks;
  /** Diagonal of the scene. */
  private readonly extent: number;
  /** Of the arrow or bar at hand: thousands a picture, so none makes objects of its own. */
  private readonly at: Vec = [0, 0, 0];
  private readonly way: Vec = [0, 0, 0];
  private readonly reference: { velocity: number; contact: number; impact: number };

  constructor(
    private readonly run: Run,
    private readonly world: World,
    looks: Look[],
    shared: Record<string, IUniform>,
  ) {
    const few = run.count <= MOST_NUMBERED;
    this.extent = Math.hypot(...world.box[1].map((c, k) => c - world.box[0][k]));
    this.shown = {
      trails: few && run.frames > 1 ? "recent" : "off",
      velocities: false,
      contacts: false,
      impacts: few && run.impacts !== undefined,
      links: true,
      through: false,
      scale: 1,
    };
    this.trails = new Trails(run, looks, shared);
    this.flashes = new Flashes(shared, 1);
    this.arrows = new Sticks(shared, 0);
    this.rods = new Sticks(shared, 4.2);
    this.links = new Links(run, world.size);
    this.among.add(this.trails.mesh, this.rods.mesh);
    this.onTop.add(this.arrows.mesh, this.flashes.mesh);
    this.reference = {
      velocity: greatest(run, (n, frame) => run.velocityOf(n, frame)) || 1,
      // Impacts and a few contacts of a pile carry much more than the others: these must not make all others vanish.
      contact: run.contacts?.quantile(few ? 0.9 : 0.98) ?? 0,
      impact: run.impacts?.quantile(few ? 1 : 0.98) ?? 0,
    };
  }

  /** For the run as sampled; an impact flashes for `hold` seconds of the run. `width` and `height` in device pixels. */
  update(selected: number, hold: number, width: number, height: number): void {
    const { shown } = this;
    this.largest = {};
    this.badges = [];
    this.cut = false;
    this.arrows.clear();
    this.rods.clear();
    this.flashes.clear();
    this.trails.length = shown.trails;
    this.trails.update(selected, width, height);
    if (shown.links) this.links.draw(this.rods, this.arrows);
    this.outline();
    if (shown.contacts) this.contacts();
    if (shown.velocities) this.velocities();
    if (shown.impacts) this.impacts(hold);
    this.arrows.done();
    this.rods.done();
    this.flashes.done();
  }

  /** The edges of a periodic box that deforms. */
  private outline(): void {
    const { run, world } = this;
    if (!run.box || !run.boxes!.deform) return;
    const [low, high] = [0, 1].map((end) => add(run.facts.box[end], run.origin, -1));
    for (const [from, to] of edges(run.box, low, high, run.origin)) this.rods.rod(from, to, 0.06 * world.size, EDGE);
  }

  private velocities(): void {
    const { run, world } = this;
    const length = Math.min(Math.max(0.14 * this.extent, 4 * world.size), 16 * world.size) * this.shown.scale;
    let largest = 0;
    for (let n = 0; n < run.count; n++) {
      if (!run.present(n)) continue;
      const v = run.velocityOf(n, run.frame, this.way);
      const speed = norm(v[0], v[1], v[2]);
      largest = Math.max(largest, speed);
      if (speed <= 1e-4 * this.reference.velocity) continue;
      const s = length / this.reference.velocity;
      for (let k = 0; k < 3; k++) {
        this.at[k] = run.centre[4 * n + k];
        v[k] *= s;
      }
      this.arrows.arrow(this.at, v, 0.14 * world.size, VELOCITY);
    }
    this.largest.velocity = largest;
  }

  /** Arrows where there are few balls; in a pile bars from centre to centre, as thick as the force: its chains. */
  private contacts(): void {
    const { run } = this;
    const { contacts } = run;
    if (!contacts) return;
    const chains = run.count > MOST_NUMBERED;
    const [from, to] = contacts.at(run.frame);
    let largest = 0;
    for (let row = from; row < to; row++) {
      const first = contacts.first(row);
      if (!run.present(first)) continue;
      const size = contacts.size(row);
      largest = Math.max(largest, size);
      if (size < (chains ? 0.02 : 1e-4) * this.reference.contact) continue;
      if (chains) this.chain(row, first, size / this.reference.contact);
      else this.pair(contacts, row, this.reference.contact, touch(contacts, row, run.centre, 4 * first, run.radius[first], this.at));
    }
    this.largest.contact = largest;
  }

  private chain(row: number, first: number, share: number): void {
    const contacts = this.run.contacts!;
    const { centre, radius } = this.run;
    const second = contacts.second(row);
    const reach = radius[first] + (second >= 0 ? radius[second] : 0);
    for (let k = 0; k < 3; k++) {
      this.at[k] = centre[4 * first + k];
      this.way[k] = this.at[k] - reach * contacts.normal(row, k);
    }
    this.cut ||= share > LONGEST;
    this.arrows.rod(this.at, this.way, 0.3 * this.world.size * this.shown.scale * Math.min(share, LONGEST), TINTS[contacts.status(row)]);
  }

  /** What acts on the first ball, and its opposite on the second, if that is a ball. */
  private pair(pairs: Pairs, row: number, reference: number, at: Vec): void {
    const { run, world, way } = this;
    const first = pairs.first(row);
    const tint = TINTS[pairs.status(row)];
    const share = pairs.size(row) / reference;
    this.cut ||= share > LONGEST;
    const s = (Math.min(LENGTH * world.size, 0.4 * this.extent) * this.shown.scale * Math.min(1, LONGEST / share)) / reference;
    for (let k = 0; k < 3; k++) way[k] = s * pairs.vector[3 * row + k];
    const thick = 0.13 * Math.min(world.size, run.radius[first]);
    this.arrows.arrow(at, way, thick, tint);
    if (pairs.second(row) < 0) return;
    for (let k = 0; k < 3; k++) way[k] = -way[k];
    this.arrows.arrow(at, way, thick, tint);
  }

  private impacts(hold: number): void {
    const { run } = this;
    const { impacts } = run;
    if (!impacts) return;
    const to = impacts.after(run.now);
    // Those of one step stand for one instant: only the latest step gets its arrows and numbers.
    const [latest] = impacts.latest(run.now);
    const numbers = new Map<string, Badge>();
    for (let row = to - 1; row >= 0 && to - row <= MOST_FLASHES; row--) {
      const left = 1 - (run.now - impacts.time[row]) / hold;
      if (left <= 0) break;
      const first = impacts.first(row);
      const second = impacts.second(row);
      const at = this.place(row);
      const size = impacts.size(row);
      const status = impacts.status(row);
      const order = impacts.problem[row];
      if (order > 0) this.flashes.put(at, 1.25 * run.radius[first], SCREEN[status], left);
      if (row < latest || size === 0) continue;
      this.largest.impact = Math.max(this.largest.impact ?? 0, size);
      this.pair(impacts, row, this.reference.impact, at);
      if (order === 0) continue;
      // A contact may be struck several times in a sequence; rows are read from the last to the first.
      const key = `${first} ${second}`;
      const known = numbers.get(key);
      numbers.set(key, { at, status: known?.status ?? status, text: known ? `${order}, ${known.text}` : String(order) });
    }
    this.badges = [...numbers.values()];
  }

  /** Where the pair of an impact touched, at the time of it. */
  private place(row: number): Vec {
    const { run } = this;
    const impacts = run.impacts!;
    const first = impacts.first(row);
    const t = impacts.time[row];
    const frame = run.frameAt(t);
    const next = Math.min(frame + 1, run.frames - 1);
    const span = run.time[next] - run.time[frame];
    const s = span > 0 ? Math.min(1, (t - run.time[frame]) / span) : 0;
    const before: Vec = [0, 0, 0];
    const after: Vec = [0, 0, 0];
    run.centreAt(frame, first, before);
    run.centreAt(next, first, after);
    const at = before.map((c, k) => c + s * (after[k] - c));
    if (run.boxes) {
      const shift: Vec = [0, 0, 0];
      shiftOf(run.boxes.at(frame, next, s), at.map((x, k) => x + run.origin[k]), shift);
      for (let k = 0; k < 3; k++) at[k] -= shift[k];
    }
    return touch(impacts, row, at, 0, run.radius[first], [0, 0, 0]);
  }
}
