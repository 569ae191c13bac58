// What each body looks like: a billiard ball, as the page says, where there are few, a two-tone grain where there are many.

import type { Run } from "./run";

/** The first four are carom/scene/billiards/look.py's KINDS, in their order. */
export const enum Kind {
  Cue,
  Solid,
  Stripe,
  Dotted,
  Grain,
}

export interface Look {
  kind: Kind;
  colour: [number, number, number]; // linear
  css: string;
  label: string; // on the ball
}

/** Above this many, numbers could not be read. */
export const MOST_NUMBERED = 64;

// Many grains: hues far apart, of like lightness.
const GRAINS = ["#4f86c6", "#e08e45", "#5aa469", "#c8553d", "#8a6fb3", "#d9b44a", "#4aa3a2", "#c77d9b"];

export function looks(run: Run): Look[] {
  const { balls } = run.facts;
  if (balls) return balls.map(([kind, css, label]) => paint(kind, css, label));
  return run.names.map((_, n) => paint(Kind.Grain, GRAINS[scatter(n) % GRAINS.length], ""));
}

function paint(kind: Kind, css: string, label: string): Look {
  return { kind, css, label, colour: linear(css) };
}

export function linear(css: string): [number, number, number] {
  return [1, 3, 5].map((i) => {
    const c = parseInt(css.slice(i, i + 2), 16) / 255;
    return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  }) as [number, number, number];
}

/** Neighbours in a lattice should not share a colour: scramble the index. */
function scatter(n: number): number {
  const mixed = Math.imul(n + 1, 0x9e3779b1);
  return Math.imul(mixed ^ (mixed >>> 15), 0x85ebca6b) >>> 16;
}
