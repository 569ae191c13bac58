// What the run's infinite planes are drawn as. A plane that carries is a floor, bounded by the planes that
// stand on it and by the room the balls use; those planes become rims along the floor's edges, low enough
// to hide no ball; where balls pile higher they are glazed as well. Four rims around a flat floor and few
// balls make a billiard table. A table of the billiards kit brings its own triangles.

import { MOST_NUMBERED } from "./palette";
import type { Plane, Run, Vec, Wall } from "./run";
import { shape } from "./shapes";
import { add, basis, cross, dot, scale, unit } from "./vec";

export interface Edge {
  /** Plane that stands along this edge, if any; otherwise the floor merely ends here. */
  wall: Plane | undefined;
  /** Outward, in the floor. */
  out: Vec;
}

/** A convex piece of a plane; edge i runs from corner i to the next. Corners are relative to run.origin. */
export interface Face {
  plane: Plane;
  offset: number;
  corners: Vec[];
  edges: Edge[];
}

export interface World {
  up: Vec;
  across: Vec;
  floors: Face[];
  panes: Face[];
  /** What is drawn of the planes that move, where it is at the start. */
  sheets: Map<Wall, Face>;
  /** Typical ball: rims and margins are measured by it. */
  size: number;
  /** What a camera should have in view. */
  box: [Vec, Vec];
  table: boolean;
}

export function layOut(run: Run): World {
  const up = unit(scale(run.facts.gravity, -1));
  const size = [...run.radius].sort((a, b) => a - b)[run.count >> 1];
  const largest = Math.max(...run.radius.slice(0, 100_000));
  const low = add(run.facts.box[0], run.origin, -1).map((c) => c - largest) as Vec;
  const high = add(run.facts.box[1], run.origin, -1).map((c) => c + largest) as Vec;
  const extent = Math.max(...high.map((h, k) => h - low[k]));
  const planes = run.facts.planes.map((p) => ({ ...p, point: add(p.point, run.origin, -1) }));
  const isFloor = (p: Plane) => dot(p.normal, up) > 0.5;
  const isWall = (p: Plane) => Math.abs(dot(p.normal, up)) <= 0.5;

  // Walls may be far from where the balls went: a floor reaches to a wall if that is near enough to matter.
  const wide = 1.5 * extent + 8 * size;
  const near = 0.12 * extent + 5 * size;
  const kit = run.facts.table;
  const floors = planes.filter(isFloor).flatMap((plane) => {
    if (kit && plane.name === "bed") return [bed(plane, kit.size)];
    const walls = planes.filter((w) => isWall(w) && reaches(w, low, high, wide));
    const box = boxPlanes(low, high, up, (axis) => (walls.some((w) => Math.abs(dot(w.normal, axis) + 1) < 0.1) ? wide : near));
    return face(plane, walls, box, extent + wide);
  });
  const height = Math.max(...corners(low, high).map((c) => dot(c, up))) - Math.min(...corners(low, high).map((c) => dot(c, up)));
  const tall = height > 7 * size;
  const panes = planes
    .filter((p) => !isFloor(p) && (tall || floors.length === 0))
    .flatMap((plane) => {
      const others = planes.filter((p) => p !== plane);
      return face(plane, others, boxPlanes(low, high, up, () => 2 * size), extent + wide);
    });

  const box: [Vec, Vec] = [[...low], [...high]];
  const closed = floors.filter((f) => f.edges.every((e) => e.wall));
  const drawn = kit?.box.map((c) => add(c, run.origin, -1)) ?? [];
  for (const c of [...closed.flatMap((f) => f.corners), ...drawn]) {
    for (let k = 0; k < 3; k++) {
      box[0][k] = Math.min(box[0][k], c[k]);
      box[1][k] = Math.max(box[1][k], c[k]);
    }
  }
  const moving = new Map(
    run.walls
      .filter((w) => w.shape === "plane")
      .map((w) => [w, { name: w.name, point: add(w.point, run.origin, -1), normal: w.axis! } as Plane]),
  );
  const sheets = new Map<Wall, Face>();
  for (const [wall, plane] of moving) {
    const others = [...planes, ...moving.values()].filter((p) => p !== plane);
    const [sheet] = face(plane, others, boxPlanes(low, high, up, () => 2 * size), extent + wide);
    if (sheet) sheets.set(wall, sheet);
  }
  for (const wall of run.walls) widen(box, wall, add(wall.point, run.origin, -1), low, high, extent);
  const table =
    kit !== undefined ||
    (closed.length === 1 && floors.length === 1 && closed[0].edges.length === 4 && !tall && run.count <= MOST_NUMBERED &&
    dot(closed[0].plane.normal, up) > 0.999);
  return { up, across: acrossScreen(box, up), floors, panes, sheets, size, box, table };
}

/** The playing area of a table of the kit, with the point of its bed in a corner. */
function bed(plane: Plane, [length, width]: [number, number]): Face {
  const corners = [[0, 0, 0], [length, 0, 0], [length, width, 0], [0, width, 0]].map((c) => add(plane.point, c as Vec));
  const out: Vec[] = [[0, -1, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0]];
  return { plane, offset: dot(plane.point, plane.normal), corners, edges: out.map((out) => ({ wall: plane, out })) };
}

/** Takes a wall that has an end into view, as far as it is not out of all proportion to where the balls are. */
function widen(box: [Vec, Vec], wall: Wall, point: Vec, low: Vec, high: Vec, extent: number): void {
  if (wall.shape === "plane" || (wall.shape === "cylinder" && wall.length === undefined)) return;
  const { position } = shape(wall, point, 1, 0);
  for (let i = 0; i < position.length; i++) {
    const k = i % 3;
    box[0][k] = Math.min(box[0][k], Math.max(position[i], low[k] - 3 * extent));
    box[1][k] = Math.max(box[1][k], Math.min(position[i], high[k] + 3 * extent));
  }
}

/** The longest level direction of the box: it should lie across the screen, with its axis to the right as on paper. */
function acrossScreen(box: [Vec, Vec], up: Vec): Vec {
  const [u, v] = basis(up);
  const reach = (d: Vec) => [0, 1, 2].reduce((sum, k) => sum + Math.abs(d[k]) * (box[1][k] - box[0][k]), 0);
  const long = reach(v) > 1.15 * reach(u) ? v : u;
  const main = long.reduce((a, b) => (Math.abs(b) > Math.abs(a) ? b : a));
  return main < 0 ? scale(long, -1) : long; // where y is up, v is -z
}

export function corners(low: Vec, high: Vec): Vec[] {
  return Array.from({ length: 8 }, (_, i) => [0, 1, 2].map((k) => (i & (1 << k) ? high[k] : low[k])) as Vec);
}

function reaches(wall: Plane, low: Vec, high: Vec, distance: number): boolean {
  const gaps = corners(low, high).map((c) => dot(add(c, wall.point, -1), wall.normal));
  return Math.min(...gaps) < distance;
}

/** The room the balls use as planes, pushed out sideways by `margin` and hardly upwards. */
function boxPlanes(low: Vec, high: Vec, up: Vec, margin: (axis: Vec) => number): Plane[] {
  return [0, 1, 2].flatMap((k) =>
    [1, -1].map((sign) => {
      const axis: Vec = [0, 0, 0];
      axis[k] = sign;
      const skyward = dot(axis, up) > 0.9;
      const point = add(sign > 0 ? high : low, axis, (skyward ? 0.05 : 1) * margin(axis));
      return { name: "", point, normal: scale(axis, -1) };
    }),
  );
}

/** The part of `plane` on the free side of all others; nothing if there is none. */
function face(plane: Plane, walls: Plane[], box: Plane[], reach: number): Face[] {
  const [u, v] = basis(plane.normal);
  const centre = add(box[0].point, box[1].point).map((c) => c / 2) as Vec;
  const middle = add(centre, plane.normal, -dot(add(centre, plane.point, -1), plane.normal));
  let polygon: { at: Vec; by: Plane | undefined }[] = [
    [1, 1],
    [-1, 1],
    [-1, -1],
    [1, -1],
  ].map(([a, b]) => ({ at: add(add(middle, u, 2 * a * reach), v, 2 * b * reach), by: undefined }));
  for (const cut of [...walls, ...box]) {
    if (Math.abs(dot(cut.normal, plane.normal)) > 0.999) continue;
    const gap = (p: Vec) => dot(add(p, cut.point, -1), cut.normal);
    const next: typeof polygon = [];
    polygon.forEach(({ at, by }, i) => {
      const to = polygon[(i + 1) % polygon.length].at;
      const [g, h] = [gap(at), gap(to)];
      // An edge that starts where this cut begins is made by the cut.
      if (g >= 0) next.push({ at, by });
      if (g >= 0 !== h >= 0) next.push({ at: add(at, add(to, at, -1), g / (g - h)), by: g >= 0 ? cut : by });
    });
    polygon = next;
    if (polygon.length < 3) return [];
  }
  const edges = polygon.map(({ at, by }, i) => {
    const along = add(polygon[(i + 1) % polygon.length].at, at, -1);
    return { wall: by && walls.includes(by) ? by : undefined, out: unit(cross(along, plane.normal)) };
  });
  return [{ plane, offset: dot(plane.point, plane.normal), corners: polygon.map((p) => p.at), edges }];
}
