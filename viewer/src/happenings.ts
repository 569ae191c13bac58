// What happened to the balls: impacts, contact forces, energies. Columns as carom/show/viewer/happenings.py wrote them.

import { decode, type Packed } from "./codec";
import type { Vec } from "./run";
import { norm } from "./vec";

export const enum Status {
  Open,
  Stick,
  Slip,
}

export const STATUS_WORDS = ["open", "stick", "slip"];

/** Where an array of doubles lies in the page's data. */
export interface Doubles {
  offset: number;
  shape: [number];
}

export interface HappeningArrays {
  impact_time?: Doubles;
  impact_body?: Packed;
  impact_problem?: Packed;
  impact_status?: Packed;
  impact_normal?: Packed;
  impact_impulse?: Packed;
  impact_speed?: Packed;
  contact_end?: Packed;
  contact_body?: Packed;
  contact_status?: Packed;
  contact_normal?: Packed;
  contact_force?: Packed;
  energy?: Doubles;
}

const UNIT = 32767; // as in happenings.py

function whole(data: Uint8Array, entry: Packed): Int32Array<ArrayBuffer> {
  return decode(data, entry, new Int32Array(entry.shape.reduce((a, b) => a * b)));
}

/** 32-bit floats, packed as the integers of the same bits. */
function floats(data: Uint8Array, entry: Packed): Float32Array {
  return new Float32Array(whole(data, entry).buffer);
}

/** A copy, because a view would have to lie at a multiple of eight bytes. */
export function doubles(data: Uint8Array, entry: Doubles): Float64Array {
  return new Float64Array(data.slice(entry.offset, entry.offset + 8 * entry.shape[0]).buffer);
}

/** Pairs of bodies with a vector each: -1 - w is wall w. The vector is what acts on the first body. */
export abstract class Pairs {
  protected constructor(
    readonly body: Int32Array,
    private readonly states: Int32Array,
    private readonly normals: Int32Array,
    /** Three components a row: impulses in N s, forces in N. */
    readonly vector: Float32Array,
  ) {}

  get count(): number {
    return this.states.length;
  }
  first(row: number): number {
    return this.body[2 * row];
  }
  second(row: number): number {
    return this.body[2 * row + 1];
  }
  status(row: number): Status {
    return this.states[row];
  }
  /** Component k of the normal, from the second to the first body. */
  normal(row: number, k: number): number {
    return this.normals[3 * row + k] / UNIT;
  }
  size(row: number): number {
    const { vector } = this;
    return norm(vector[3 * row], vector[3 * row + 1], vector[3 * row + 2]);
  }

  /** The size that `share` of all rows do not exceed. */
  quantile(share: number): number {
    const stride = Math.max(1, Math.floor(this.count / 20_000));
    const sizes = Array.from({ length: Math.ceil(this.count / stride) }, (_, i) => this.size(i * stride));
    sizes.sort((a, b) => a - b);
    return sizes[Math.min(sizes.length - 1, Math.floor(share * sizes.length))] ?? 0;
  }
}

/** One row per contact and impact problem, in the order of time and, within a step, of the sequence. */
export class Impacts extends Pairs {
  private constructor(
    data: Uint8Array,
    arrays: Required<HappeningArrays>,
    readonly time: Float64Array = doubles(data, arrays.impact_time),
    /** Place in the sequence of its step, from 1; 0: pushed by loads in a step with impacts. */
    readonly problem: Int32Array = whole(data, arrays.impact_problem),
    private readonly speeds: Float32Array = floats(data, arrays.impact_speed),
  ) {
    super(
      whole(data, arrays.impact_body),
      whole(data, arrays.impact_status),
      whole(data, arrays.impact_normal),
      floats(data, arrays.impact_impulse),
    );
  }

  static read(data: Uint8Array, arrays: HappeningArrays): Impacts | undefined {
    return arrays.impact_time && new Impacts(data, arrays as Required<HappeningArrays>);
  }

  approach(row: number): number {
    return this.speeds[2 * row];
  }
  separation(row: number): number {
    return this.speeds[2 * row + 1];
  }

  /** The first row later than `t`. */
  after(t: number): number {
    let low = 0;
    let high = this.time.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time[middle] <= t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The rows of the latest step with impacts at or before `t`; empty before the first. */
  latest(t: number): [from: number, to: number] {
    const to = this.after(t);
    if (to === 0) return [0, 0];
    let from = to;
    while (from > 0 && this.time[from - 1] === this.time[to - 1]) from--;
    return [from, to];
  }
}

/** Mean forces between two recorded frames, at the later one. */
export class Contacts extends Pairs {
  private readonly ends: Int32Array;

  private constructor(
    data: Uint8Array,
    arrays: Required<HappeningArrays>,
    /** Contacts are known of one frame in so many. */
    readonly every: number,
  ) {
    super(
      whole(data, arrays.contact_body),
      whole(data, arrays.contact_status),
      whole(data, arrays.contact_normal),
      floats(data, arrays.contact_force),
    );
    this.ends = whole(data, arrays.contact_end);
  }

  static read(data: Uint8Array, arrays: HappeningArrays, every: number): Contacts | undefined {
    return arrays.contact_end && new Contacts(data, arrays as Required<HappeningArrays>, every);
  }

  /** Rows of a frame, or of the last one before it of which they are known. */
  at(frame: number): [from: number, to: number] {
    const k = Math.min(Math.floor(frame / this.every), this.ends.length - 1);
    return [k > 0 ? this.ends[k - 1] : 0, this.ends[k]];
  }
}

/** Energies after steps, J. */
export class Energies {
  private constructor(
    readonly time: Float64Array,
    readonly kinetic: Float64Array,
    readonly potential: Float64Array,
  ) {}

  static read(data: Uint8Array, arrays: HappeningArrays): Energies | undefined {
    if (!arrays.energy) return undefined;
    const all = doubles(data, arrays.energy);
    const rows = all.length / 3;
    return new Energies(all.subarray(0, rows), all.subarray(rows, 2 * rows), all.subarray(2 * rows));
  }
}

/** Into `out`: where the pair of a row touches, given the centre of its first ball. */
export function touch(pairs: Pairs, row: number, centre: ArrayLike<number>, at: number, radius: number, out: Vec): Vec {
  for (let k = 0; k < 3; k++) out[k] = centre[at + k] - radius * pairs.normal(row, k);
  return out;
}
