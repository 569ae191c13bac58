// Periodic boxes: where a centre is drawn, and the edges of a box that deforms.

import type { Vec } from "./run";

/** A periodic box at a time. Lengths are 0 along axes that do not repeat; `low` is its corner before the shear. */
export interface Box {
  lengths: Vec;
  low: Vec;
  /** The image one up along `gradient` is displaced by `tilt` along `flow`, at most half a length. */
  flow: number;
  gradient: number;
  tilt: number;
}

/** The boxes of all frames: one, or `rows` of lengths and offset that differ from frame to frame. */
export class Boxes {
  private readonly middle: Vec;

  constructor(
    private readonly first: Box,
    private readonly rows: Float64Array | undefined,
  ) {
    this.middle = [0, 1, 2].map((k) => first.low[k] + 0.5 * first.lengths[k]) as Vec;
  }

  get deform(): boolean {
    return this.rows !== undefined;
  }

  /** The box a fraction `s` from a frame to the next one. */
  at(frame: number, next: number, s: number): Box {
    const { first, rows } = this;
    if (!rows) return first;
    const [x, y, z, offset] = [0, 1, 2, 3].map((k) => rows[4 * frame + k] + s * (rows[4 * next + k] - rows[4 * frame + k]));
    const lengths: Vec = [x, y, z];
    const along = lengths[first.flow];
    return {
      ...first,
      lengths,
      low: this.middle.map((c, k) => c - 0.5 * lengths[k]) as Vec,
      tilt: along ? offset - along * Math.round(offset / along) : 0,
    };
  }
}

/** What to take off a place so that it lies in the box, into `out`. */
export function shiftOf(box: Box, place: ArrayLike<number>, out: Float64Array | Vec): void {
  const { lengths, low, flow, gradient, tilt } = box;
  for (let k = 0; k < 3; k++) {
    if (!lengths[k]) {
      out[k] = 0;
      continue;
    }
    // A box that is sheared is a parallelepiped about its middle.
    const across = k === flow && tilt ? tilt * ((place[gradient] - low[gradient]) / lengths[gradient] - 0.5) : 0;
    out[k] = lengths[k] * Math.floor((place[k] - low[k] - across) / lengths[k]);
  }
  if (tilt) out[flow] += (tilt * out[gradient]) / lengths[gradient];
}

/** The edges of a box as pairs of ends, which along other axes reaches from `low` to `high`; all relative to `origin`. */
export function edges(box: Box, low: Vec, high: Vec, origin: Vec): [Vec, Vec][] {
  const corner = (i: number): Vec => {
    const place = [0, 1, 2].map((k) => {
      const up = (i >> k) & 1;
      return box.lengths[k] ? box.low[k] + up * box.lengths[k] - origin[k] : up ? high[k] : low[k];
    }) as Vec;
    if (box.tilt) place[box.flow] += box.tilt * (((i >> box.gradient) & 1) - 0.5);
    return place;
  };
  const found: [Vec, Vec][] = [];
  for (let i = 0; i < 8; i++) for (let k = 0; k < 3; k++) if (!((i >> k) & 1)) found.push([corner(i), corner(i | (1 << k))]);
  return found;
}
