// Three-vectors as plain arrays: what the geometry of planes needs and no more.

import type { Vec } from "./run";

export const add = (a: Vec, b: Vec, s = 1): Vec => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
export const scale = (a: Vec, s: number): Vec => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a: Vec, b: Vec): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec, b: Vec): Vec => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
/** For each ball of each picture: other than Math.hypot it makes no objects. */
export const norm = (x: number, y: number, z: number): number => Math.sqrt(x * x + y * y + z * z);
export const unit = (a: Vec): Vec => scale(a, 1 / (Math.hypot(...a) || 1));

/** Two directions that span the plane with normal n, the first as near to the widest axis as can be. */
export function basis(n: Vec): [Vec, Vec] {
  const axes: Vec[] = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ];
  const axis = axes.find((a) => Math.abs(dot(a, n)) < 0.8)!;
  const u = unit(add(axis, n, -dot(axis, n)));
  return [u, cross(n, u)];
}
