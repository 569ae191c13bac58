// A run as the page holds it, and its state at any time between frames.

import { decode, unpack, type Packed } from "./codec";
import { Contacts, doubles, Energies, Impacts, type Doubles, type HappeningArrays } from "./happenings";
import type { Link } from "./links";
import { Boxes, shiftOf, type Box } from "./periodic";
import { Poses } from "./poses";
import { norm } from "./vec";

export type Vec = [number, number, number];

export interface Plane {
  name: string;
  point: Vec;
  normal: Vec;
}

/** A wall that is no resting plane; what its shape does not have is left out. */
export interface Wall {
  name: string;
  shape: "plane" | "rectangle" | "disc" | "cylinder" | "sphere" | "cone" | "mesh";
  point: Vec;
  /** Of what is flat the normal. */
  axis?: Vec;
  side?: Vec;
  size?: [number, number];
  radius?: number;
  hole?: number;
  /** Radius of the last ring of a cone. */
  end?: number;
  length?: number;
  inside?: boolean;
  /** Of a mesh: points relative to its own, three numbers each; triangles of three points; sharp edges of two. */
  vertices?: number[];
  triangles?: number[];
  edges?: number[];
  /** Which of the poses, if it moves. */
  pose?: number;
  /** When it is taken away, s. */
  until?: number;
}

/** Triangles of a table; places are relative to run.origin, kinds are numbers of facts.table.kinds. */
export interface Mesh {
  position: Float32Array;
  normal: Float32Array;
  kind: Float32Array;
  index: number[];
}

interface Facts {
  format: number;
  title: string;
  names: string[];
  radius: number[];
  box: [Vec, Vec];
  planes: Plane[];
  walls?: Wall[];
  /** Periods along x, y, z (0: none) and the lowest corner of the periodic box. */
  period?: [Vec, Vec];
  /** Of a periodic box that deforms: the axis along which images are displaced, and the one across which they are. */
  shear?: [number, number];
  /** A table of the billiards kit: what its parts are, length and width, a ball's radius, the box of all of it. */
  table?: { kinds: string[]; size: [number, number]; radius: number; box: [Vec, Vec] };
  /** Of tables, by day and in the dark. */
  colours: Record<"cloth" | "wood" | "liner" | "sight" | "line", [string, string]>;
  /** What is on each ball, its colour and number, where there are few. */
  balls?: [kind: number, css: string, label: string][];
  gravity: Vec;
  marks: number[];
  notes: string[];
  links?: Link[];
  wall_names?: string[];
  contact_every?: number;
  arrays: HappeningArrays & {
    time: { shape: [number] };
    position: Packed;
    orientation: Packed;
    velocity?: Packed;
    angular_velocity?: Packed;
    present?: Packed;
    /** Lengths and offset of a periodic box that deforms, four numbers a frame. */
    boxes?: Doubles;
    wall_position?: Packed;
    wall_orientation?: Packed;
    table_points?: Packed;
    table_normals?: Packed;
    table_kinds?: Packed;
    table_faces?: Packed;
  };
}

/** Coordinates inside are measured from `origin`, so that single precision on the GPU suffices far from zero. */
export class Run {
  readonly frames: number;
  readonly count: number;
  readonly time: Float64Array;
  /** Poses of the walls that move. */
  readonly poses: Poses | undefined;
  readonly impacts: Impacts | undefined;
  readonly contacts: Contacts | undefined;
  readonly energies: Energies | undefined;
  readonly table: Mesh | undefined;
  /** The periodic boxes, and that of the sampled time. */
  readonly boxes: Boxes | undefined;
  box: Box | undefined;
  /** State at the sampled time: x y z and radius (0 where there is no ball now), then the quaternion x y z w. */
  readonly centre: Float32Array;
  readonly attitude: Float32Array;
  /** The sampled time, and the frame at or before it. */
  now = 0;
  frame = 0;
  /** How far the sampled time is from that frame to the next, as a fraction. */
  private part = 0;

  private readonly position: Int32Array;
  private readonly orientation: Int16Array;
  private readonly velocity: Int32Array | undefined;
  private readonly spin: Int32Array | undefined;
  private readonly there: Int32Array | undefined;
  /** Spin of the body at hand. */
  private readonly rate: Vec = [0, 0, 0];
  /** Change over the second of two intervals. */
  private readonly second: Vec = [0, 0, 0];

  private constructor(
    readonly facts: Facts,
    data: Uint8Array<ArrayBuffer>,
  ) {
    const { arrays } = facts;
    const wide = (entry: Packed) => decode(data, entry, new Int32Array(entry.shape.reduce((a, b) => a * b)));
    this.frames = arrays.time.shape[0];
    this.count = facts.names.length;
    this.time = new Float64Array(data.buffer, data.byteOffset, this.frames);
    this.position = wide(arrays.position);
    this.orientation = decode(data, arrays.orientation, new Int16Array(this.frames * this.count * 4));
    this.velocity = arrays.velocity && wide(arrays.velocity);
    this.spin = arrays.angular_velocity && wide(arrays.angular_velocity);
    this.there = arrays.present && wide(arrays.present);
    if (arrays.wall_position && arrays.wall_orientation) {
      this.poses = new Poses(data, arrays.wall_position, arrays.wall_orientation, arrays.position.origin!);
    }
    this.impacts = Impacts.read(data, arrays);
    this.contacts = Contacts.read(data, arrays, facts.contact_every ?? 1);
    this.energies = Energies.read(data, arrays);
    const { table_points, table_normals, table_kinds, table_faces } = arrays;
    if (table_points && table_normals && table_kinds && table_faces) {
      const scaled = (entry: Packed) => Float32Array.from(wide(entry), (i) => i * entry.step!);
      this.table = {
        position: scaled(table_points),
        normal: scaled(table_normals),
        kind: Float32Array.from(wide(table_kinds)),
        index: [...wide(table_faces)],
      };
    }
    if (facts.period) {
      const [lengths, low] = facts.period;
      const [flow, gradient] = facts.shear ?? [0, 1];
      this.boxes = new Boxes({ lengths, low, flow, gradient, tilt: 0 }, arrays.boxes && doubles(data, arrays.boxes));
    }
    this.centre = new Float32Array(4 * this.count);
    this.attitude = new Float32Array(4 * this.count);
    this.sample(this.start);
  }

  static async read(facts: string, motion: string): Promise<Run> {
    const parsed = JSON.parse(facts) as Facts;
    if (parsed.format !== 1) throw new Error(`this page's data have format ${parsed.format}, the viewer reads 1`);
    return new Run(parsed, await unpack(motion));
  }

  get start(): number {
    return this.time[0];
  }
  get end(): number {
    return this.time[this.frames - 1];
  }
  get origin(): Vec {
    return this.facts.arrays.position.origin!;
  }
  get names(): string[] {
    return this.facts.names;
  }
  get radius(): number[] {
    return this.facts.radius;
  }
  get walls(): Wall[] {
    return this.facts.walls ?? [];
  }
  /** Name of a body, or of the wall -1 - n. */
  nameOf(n: number): string {
    return n >= 0 ? this.names[n] : (this.facts.wall_names?.[-1 - n] ?? "wall");
  }
  /** Whether a body is there at a frame, by default that of the sampled time. */
  present(n: number, frame = this.frame): boolean {
    return this.there === undefined || this.there[this.count * frame + n] !== 0;
  }
  /** Into `out`: centre of a body at a frame, relative to the origin, not folded into a period. */
  centreAt(frame: number, n: number, out: Float64Array | Vec): void {
    const step = this.facts.arrays.position.step!;
    const at = 3 * (this.count * frame + n);
    for (let k = 0; k < 3; k++) out[k] = step * this.position[at + k];
  }
  /** False where rates come from positions and attitudes, because the page left the recorded ones out. */
  get hasRates(): boolean {
    return this.velocity !== undefined;
  }

  /** The last frame at or before `t`. */
  frameAt(t: number): number {
    let low = 0;
    let high = this.frames - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.time[middle] <= t) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** Moves `centre` and `attitude` to time `t`. */
  sample(t: number): void {
    this.now = Math.min(Math.max(t, this.start), this.end);
    this.frame = this.frameAt(this.now);
    const next = Math.min(this.frame + 1, this.frames - 1);
    const span = this.time[next] - this.time[this.frame];
    const s = (this.part = span > 0 ? (this.now - this.time[this.frame]) / span : 0);
    const { position, centre, count } = this;
    const step = this.facts.arrays.position.step!;
    const a = 3 * count * this.frame;
    const b = 3 * count * next;
    for (let n = 0; n < count; n++) {
      for (let k = 0; k < 3; k++) {
        const from = position[a + 3 * n + k];
        centre[4 * n + k] = step * (from + s * (position[b + 3 * n + k] - from));
      }
      centre[4 * n + 3] = this.present(n) ? this.facts.radius[n] : 0;
      this.turn(n, next, span, s);
    }
    this.box = this.boxes?.at(this.frame, next, s);
    if (this.box) this.fold(this.box);
    this.poses?.sample(this.frame, next, s);
  }

  /** Balls of a periodic world are drawn within one period. */
  private fold(box: Box): void {
    const { centre, origin } = this;
    const place: Vec = [0, 0, 0];
    const turns: Vec = [0, 0, 0];
    for (let n = 0; n < this.count; n++) {
      for (let k = 0; k < 3; k++) place[k] = centre[4 * n + k] + origin[k];
      shiftOf(box, place, turns);
      for (let k = 0; k < 3; k++) centre[4 * n + k] -= turns[k];
    }
  }

  /** Attitude of body n, a fraction s from this frame to the next. For each ball of each picture: makes no objects unless it spins fast. */
  private turn(n: number, next: number, span: number, s: number): void {
    const q = this.orientation;
    const out = this.attitude;
    const i = 4 * (this.count * this.frame + n);
    const j = 4 * (this.count * next + n);
    const ax = q[i] / 32767, ay = q[i + 1] / 32767, az = q[i + 2] / 32767, aw = q[i + 3] / 32767;
    const bx = q[j] / 32767, by = q[j + 1] / 32767, bz = q[j + 2] / 32767, bw = q[j + 3] / 32767;
    const rate = this.meanSpin(n, next);
    const predicted = rate ? norm(rate[0], rate[1], rate[2]) * span : 0;
    if (predicted < 2.5) {
      // Up to here the short way round is the way it went; neighbouring signs agree (see codec.py).
      const dot = ax * bx + ay * by + az * bz + aw * bw;
      const half = Math.acos(Math.min(1, Math.abs(dot)));
      const sine = Math.sin(half);
      const u = sine > 1e-3 ? Math.sin((1 - s) * half) / sine : 1 - s;
      const v = (sine > 1e-3 ? Math.sin(s * half) / sine : s) * (dot < 0 ? -1 : 1);
      write(out, 4 * n, u * ax + v * bx, u * ay + v * by, u * az + v * bz, u * aw + v * bw);
      return;
    }
    // Fast spin: two frames do not tell how many whole turns lie between, but the recorded spin does.
    let [x, y, z, w] = turnBetween(ax, ay, az, aw, bx, by, bz, bw);
    const sine = Math.hypot(x, y, z);
    if (sine < 0.05) [x, y, z] = rate!;
    const length = Math.hypot(x, y, z) || 1;
    [x, y, z] = [x / length, y / length, z / length];
    const along = (x * rate![0] + y * rate![1] + z * rate![2]) * span;
    const short = sine < 0.05 ? 0 : 2 * Math.atan2(sine, w);
    const angle = s * (short + 2 * Math.PI * Math.round((along - short) / (2 * Math.PI)));
    const [p, c] = [Math.sin(angle / 2), Math.cos(angle / 2)];
    // Spin is spatial, so the turn multiplies from the left.
    write(
      out, 4 * n,
      c * ax + p * (x * aw + y * az - z * ay),
      c * ay + p * (y * aw + z * ax - x * az),
      c * az + p * (z * aw + x * ay - y * ax),
      c * aw - p * (x * ax + y * ay + z * az),
    );
  }

  private meanSpin(n: number, next: number): Vec | undefined {
    const { spin } = this;
    if (!spin) return undefined;
    const half = 0.5 * this.facts.arrays.angular_velocity!.step!;
    const i = 3 * (this.count * this.frame + n);
    const j = 3 * (this.count * next + n);
    for (let k = 0; k < 3; k++) this.rate[k] = half * (spin[i + k] + spin[j + k]);
    return this.rate;
  }

  /** Position of body n in the scene's own coordinates, as exact as the page has it. */
  where(n: number): Vec {
    const ends = [this.frame, Math.min(this.frame + 1, this.frames - 1)].map((f) => 3 * (this.count * f + n));
    const [from, to] = ends.map((at) => this.position.subarray(at, at + 3));
    const step = this.facts.arrays.position.step!;
    return this.origin.map((o, k) => o + step * (from[k] + this.part * (to[k] - from[k]))) as Vec;
  }

  /** Velocity of body n at a frame, into `out`: as recorded, or from the positions around. */
  velocityOf(n: number, frame = this.frame, out: Vec = [0, 0, 0]): Vec {
    if (this.velocity) return this.recorded(this.velocity, this.facts.arrays.velocity!.step!, n, frame, out);
    return this.slope(n, frame, this.travel, out);
  }

  /** Spatial angular velocity of body n, likewise; attitudes cannot tell whole turns. */
  spinOf(n: number, frame = this.frame): Vec {
    if (this.spin) return this.recorded(this.spin, this.facts.arrays.angular_velocity!.step!, n, frame, [0, 0, 0]);
    return this.slope(n, frame, this.rotation, [0, 0, 0]);
  }

  /**
   * Rate at a frame, into `out`. What happens between two frames gives the mean rate, that of their middle; two such lie on
   * a straight line: one before and one after the frame, or the nearest two on the side that has them.
   */
  private slope(n: number, frame: number, change: (n: number, i: number, out: Vec) => void, out: Vec): Vec {
    const before = this.joined(n, frame - 1);
    const after = this.joined(n, frame);
    out.fill(0);
    if (!before && !after) return out;
    const near = before ? frame - 1 : frame;
    const other = before && !after ? frame - 2 : near + 1;
    const { time } = this;
    change.call(this, n, near, out);
    const span = time[near + 1] - time[near];
    for (let k = 0; k < 3; k++) out[k] /= span;
    if (!this.joined(n, other)) return out;
    const second = this.second;
    change.call(this, n, other, second);
    const away = time[other + 1] - time[other];
    const share = (2 * time[frame] - time[near] - time[near + 1]) / (time[other] + time[other + 1] - time[near] - time[near + 1]);
    for (let k = 0; k < 3; k++) out[k] += share * (second[k] / away - out[k]);
    return out;
  }

  /** Whether a body is there at a frame and at the next. */
  private joined(n: number, i: number): boolean {
    return i >= 0 && i < this.frames - 1 && this.time[i + 1] > this.time[i] && this.present(n, i) && this.present(n, i + 1);
  }

  /** By how much a body moves from a frame to the next. */
  private travel(n: number, i: number, out: Vec): void {
    const step = this.facts.arrays.position.step!;
    const at = 3 * (this.count * i + n);
    for (let k = 0; k < 3; k++) out[k] = step * (this.position[at + 3 * this.count + k] - this.position[at + k]);
  }

  /** By how much it turns, the short way round. */
  private rotation(n: number, i: number, out: Vec): void {
    const q = this.orientation;
    const a = 4 * (this.count * i + n);
    const b = a + 4 * this.count;
    const [ax, ay, az, aw, bx, by, bz, bw] = [...q.subarray(a, a + 4), ...q.subarray(b, b + 4)].map((c) => c / 32767);
    const [x, y, z, w] = turnBetween(ax, ay, az, aw, bx, by, bz, bw);
    const sine = Math.hypot(x, y, z);
    const scale = sine > 1e-9 ? (2 * Math.atan2(sine, w)) / sine : 0;
    [out[0], out[1], out[2]] = [x * scale, y * scale, z * scale];
  }

  private recorded(values: Int32Array, step: number, n: number, frame: number, out: Vec): Vec {
    const at = 3 * (this.count * frame + n);
    for (let k = 0; k < 3; k++) out[k] = step * values[at + k];
    return out;
  }
}

/** The quaternion that turns attitude a into attitude b, in spatial axes: b times the inverse of a. */
function turnBetween(
  ax: number, ay: number, az: number, aw: number, bx: number, by: number, bz: number, bw: number,
): [number, number, number, number] {
  const w = aw * bw + ax * bx + ay * by + az * bz;
  const sign = w < 0 ? -1 : 1; // the short way round
  return [
    sign * (aw * bx - ax * bw + ay * bz - az * by),
    sign * (aw * by - ay * bw + az * bx - ax * bz),
    sign * (aw * bz - az * bw + ax * by - ay * bx),
    sign * w,
  ];
}

function write(out: Float32Array, at: number, x: number, y: number, z: number, w: number): void {
  const scale = 1 / (Math.sqrt(x * x + y * y + z * z + w * w) || 1);
  out[at] = x * scale;
  out[at + 1] = y * scale;
  out[at + 2] = z * scale;
  out[at + 3] = w * scale;
}
