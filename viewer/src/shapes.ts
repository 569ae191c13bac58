// Walls as triangles, in the place where they stand at the start.

import type { Vec, Wall } from "./run";
import { add, basis, cross, dot, scale, unit } from "./vec";

const AROUND = 96; // corners of a circle
const ALONG = 24; // steps from pole to pole of a sphere
const MERIDIANS = 24; // lines around a tube, so that one sees it turn

/** Triangles, counter-clockwise as seen from where the balls live. */
export interface Shape {
  position: number[];
  normal: number[];
  /** Two coordinates that are whole numbers on lines; two distances (m) to outlines, large where there is none. */
  mesh: number[];
}

const FAR = 1e6;
type Corner = [at: Vec, normal: Vec, mesh: [number, number, number, number]];

export const empty = (): Shape => ({ position: [], normal: [], mesh: [] });

/** The triangles of a wall other than a plane, its point relative to run.origin; `spacing` (m) of lines; `reach` in place of no end. */
export function shape(wall: Wall, point: Vec, spacing: number, reach: number): Shape {
  const made = empty();
  if (wall.shape === "rectangle") rectangle(made, wall, point, spacing);
  else if (wall.shape === "disc") disc(made, wall, point, spacing);
  else if (wall.shape === "mesh") mesh(made, wall, point);
  else revolved(made, wall, point, spacing, reach);
  return made;
}

function push(into: Shape, corners: Corner[]): void {
  for (const [at, normal, mesh] of corners) {
    into.position.push(...at);
    into.normal.push(...normal);
    into.mesh.push(...mesh);
  }
}

function quad(into: Shape, a: Corner, b: Corner, c: Corner, d: Corner): void {
  push(into, [a, b, c, a, c, d]);
}

function rectangle(into: Shape, wall: Wall, point: Vec, spacing: number): void {
  const u = wall.side!;
  const v = cross(wall.axis!, u);
  const [a, b] = wall.size!.map((length) => length / 2);
  const corner = (x: number, y: number) => add(add(point, u, x), v, y);
  polygon(into, [corner(a, b), corner(-a, b), corner(-a, -b), corner(a, -b)], wall.axis!, u, spacing);
}

/** A convex polygon as triangles from its middle, on which the distance to its outline is linear. */
export function polygon(into: Shape, corners: Vec[], normal: Vec, along: Vec, spacing: number): void {
  const middle = scale(corners.reduce((a, b) => add(a, b)), 1 / corners.length);
  const across = cross(normal, along);
  const corner = (at: Vec, distance: number): Corner => {
    const from = add(at, middle, -1);
    return [at, normal, [dot(from, along) / spacing, dot(from, across) / spacing, distance, FAR]];
  };
  corners.forEach((at, i) => {
    const next = corners[(i + 1) % corners.length];
    const out = unit(cross(add(next, at, -1), normal));
    push(into, [corner(middle, dot(add(at, middle, -1), out)), corner(at, 0), corner(next, 0)]);
  });
}

function disc(into: Shape, wall: Wall, point: Vec, spacing: number): void {
  const n = wall.axis!;
  const [u, v] = basis(n);
  const hole = wall.hole ?? 0;
  const rim = wall.radius!;
  const corner = (r: number, i: number): Corner => {
    const angle = (2 * Math.PI * i) / AROUND;
    const [x, y] = [r * Math.cos(angle), r * Math.sin(angle)];
    return [add(add(point, u, x), v, y), n, [x / spacing, y / spacing, rim - r, hole > 0 ? r - hole : FAR]];
  };
  for (let i = 0; i < AROUND; i++) quad(into, corner(hole, i), corner(rim, i), corner(rim, i + 1), corner(hole, i + 1));
}

/** Triangles as they are given; lines stand on the sharp edges alone. */
function mesh(into: Shape, wall: Wall, point: Vec): void {
  const [v, t, e] = [wall.vertices!, wall.triangles!, wall.edges!];
  const name = (a: number, b: number) => `${Math.min(a, b)} ${Math.max(a, b)}`;
  const sharp = new Set<string>();
  for (let i = 0; i < e.length; i += 2) sharp.add(name(e[i], e[i + 1]));
  const at = (k: number): Vec => add(point, [v[3 * k], v[3 * k + 1], v[3 * k + 2]], 1);
  for (let i = 0; i < t.length; i += 3) {
    const names = [t[i], t[i + 1], t[i + 2]];
    const [a, b, c] = names.map(at);
    const normal = unit(cross(add(b, a, -1), add(c, a, -1)));
    const corner = (place: Vec, distance: number): Corner => [place, normal, [0.5, 0.5, distance, FAR]];
    const lines = [0, 1, 2].map((k) => sharp.has(name(names[k], names[(k + 1) % 3])));
    if (!lines.includes(true)) {
      push(into, [corner(a, FAR), corner(b, FAR), corner(c, FAR)]);
      continue;
    }
    // From the middle on, so that the distance to each edge is linear.
    const middle = scale(add(add(a, b, 1), c, 1), 1 / 3);
    [a, b, c].forEach((from, k, all) => {
      const to = all[(k + 1) % 3];
      const out = unit(cross(add(to, from, -1), normal));
      const away = lines[k] ? dot(add(from, middle, -1), out) : FAR;
      push(into, [corner(middle, away), corner(from, lines[k] ? 0 : FAR), corner(to, lines[k] ? 0 : FAR)]);
    });
  }
}

/** What a profile (distance along the axis, radius) makes when it turns about the axis. */
function revolved(into: Shape, wall: Wall, point: Vec, spacing: number, reach: number): void {
  const axis = wall.axis ?? [0, 0, 1];
  const [u, v] = basis(axis);
  const side = wall.inside ? -1 : 1;
  const profile = outline(wall, reach);
  const ends: [number, number] = [profile[0][0], profile[profile.length - 1][0]];
  const bounded = wall.shape !== "sphere" && !(wall.shape === "cylinder" && wall.length === undefined);
  const corner = (k: number, i: number): Corner => {
    const [z, r, slope] = profile[k];
    const angle = (2 * Math.PI * i) / AROUND;
    const out = add(scale(u, Math.cos(angle)), v, Math.sin(angle));
    const normal = scale(unit(add(out, axis, -slope)), side);
    const rings = wall.shape === "sphere" ? (k * 12) / ALONG : (z - ends[0]) / spacing;
    const far: [number, number] = bounded ? [z - ends[0], ends[1] - z] : [FAR, FAR];
    return [add(add(point, axis, z), out, r), normal, [(i * MERIDIANS) / AROUND, rings, ...far]];
  };
  for (let k = 0; k + 1 < profile.length; k++) {
    for (let i = 0; i < AROUND; i++) {
      const four: Corner[] = [corner(k, i), corner(k, i + 1), corner(k + 1, i + 1), corner(k + 1, i)];
      if (side > 0) quad(into, four[0], four[1], four[2], four[3]);
      else quad(into, four[3], four[2], four[1], four[0]);
    }
  }
}

/** Points (along the axis, radius, slope dr/dz) of the profile. */
function outline(wall: Wall, reach: number): [number, number, number][] {
  const r = wall.radius ?? 0;
  if (wall.shape === "sphere") {
    return Array.from({ length: ALONG + 1 }, (_, k) => {
      const angle = (Math.PI * k) / ALONG;
      const [s, c] = [Math.sin(angle), Math.cos(angle)];
      return [-r * c, r * s, c / Math.max(s, 1e-6)];
    });
  }
  if (wall.shape === "cone") {
    const end = wall.end ?? 0;
    const slope = (end - r) / wall.length!;
    return [
      [0, r, slope],
      [wall.length!, end, slope],
    ];
  }
  const half = wall.length === undefined ? reach : wall.length / 2;
  return [
    [-half, r, 0],
    [half, r, 0],
  ];
}
