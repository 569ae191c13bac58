// The walls that move, at any time between frames.

import { decode, type Packed } from "./codec";
import type { Vec } from "./run";

export class Poses {
  readonly count: number;
  /** Of each moving wall at the sampled time: its point, relative to the run's origin, and the quaternion x y z w. */
  readonly point: Float64Array;
  readonly turn: Float64Array;

  private readonly places: Int32Array;
  private readonly turns: Int16Array;

  constructor(
    data: Uint8Array,
    private readonly position: Packed,
    orientation: Packed,
    private readonly origin: Vec,
  ) {
    const [frames, count] = position.shape;
    this.count = count;
    this.places = decode(data, position, new Int32Array(frames * count * 3));
    this.turns = decode(data, orientation, new Int16Array(frames * count * 4));
    this.point = new Float64Array(3 * count);
    this.turn = new Float64Array(4 * count);
  }

  /** A fraction `s` from frame `a` to frame `b`. */
  sample(a: number, b: number, s: number): void {
    const { count, places, turns, point, turn } = this;
    const step = this.position.step!;
    for (let n = 0; n < count; n++) {
      for (let k = 0; k < 3; k++) {
        const from = places[3 * (count * a + n) + k];
        const to = places[3 * (count * b + n) + k];
        point[3 * n + k] = step * (from + s * (to - from)) + this.position.origin![k] - this.origin[k];
      }
      let length = 0;
      for (let k = 0; k < 4; k++) {
        // Signs of neighbours agree (see codec.py), and between two frames a wall turns little: straight is near enough.
        const q = (1 - s) * turns[4 * (count * a + n) + k] + s * turns[4 * (count * b + n) + k];
        turn[4 * n + k] = q;
        length += q * q;
      }
      for (let k = 0; k < 4; k++) turn[4 * n + k] /= Math.sqrt(length) || 1;
    }
  }
}
