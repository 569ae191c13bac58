// What each body looks like: a billiard ball where there are few, a two-tone grain where there are many.

import type { Run } from "./run";

export const enum Kind {
  Cue,
  Solid,
  Stripe,
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

// Pool's own colours for 1 to 8; 9 to 15 repeat them as stripes.
const POOL = ["#f2b705", "#1747b5", "#d11f26", "#5b2a86", "#ee6c15", "#0c7a45", "#7c1d24", "#17181b"];
// Many grains: hues far apart, of like lightness.
const GRAINS = ["#4f86c6", "#e08e45", "#5aa469", "#c8553d", "#8a6fb3", "#d9b44a", "#4aa3a2", "#c77d9b"];

export function looks(run: Run): Look[] {
  if (run.count > MOST_NUMBERED) return run.names.map((_, n) => paint(Kind.Grain, GRAINS[scatter(n) % GRAINS.length], ""));
  const cue = cueBall(run);
  return run.names.map((name, n) => {
    if (n === cue) return paint(Kind.Cue, "#f0e8d6", "");
    const number = Number(/(\d{1,3})\D*$/.exec(name)?.[1] ?? n + 1);
    if (number >= 1 && number <= 8) return paint(Kind.Solid, POOL[number - 1], String(number));
    if (number >= 9 && number <= 15) return paint(Kind.Stripe, POOL[number - 9], String(number));
    // Golden angle: neighbours differ, none repeats.
    const hue = Math.round((number * 137.508) % 360);
    return paint(number % 2 ? Kind.Solid : Kind.Stripe, hslToHex(hue, 0.55, 0.45), String(number));
  });
}

/** The ball called so, or the only one that moves at the start: players expect it white. */
function cueBall(run: Run): number {
  const named = run.names.findIndex((name) => /cue|white/i.test(name));
  if (named >= 0 || run.count < 3) return named;
  run.sample(run.start);
  const moving = run.names.map((_, n) => n).filter((n) => Math.hypot(...run.velocityOf(n)) > 1e-6);
  return moving.length === 1 ? moving[0] : -1;
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

function hslToHex(hue: number, saturation: number, lightness: number): string {
  const a = saturation * Math.min(lightness, 1 - lightness);
  const channel = (n: number) => {
    const k = (n + hue / 30) % 12;
    const c = lightness - a * Math.max(-1, Math.min(k - 3, 9 - k, 1));
    return Math.round(255 * c).toString(16).padStart(2, "0");
  };
  return `#${channel(0)}${channel(8)}${channel(4)}`;
}

/** Neighbours in a lattice should not share a colour: scramble the index. */
function scatter(n: number): number {
  const mixed = Math.imul(n + 1, 0x9e3779b1);
  return Math.imul(mixed ^ (mixed >>> 15), 0x85ebca6b) >>> 16;
}
