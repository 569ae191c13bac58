// The walls that are no resting planes: pieces of planes, tubes, cones, spheres, and everything that moves.

import { BufferAttribute, BufferGeometry, Color, DoubleSide, FrontSide, BackSide, GLSL3, Group, Mesh, NoBlending, RawShaderMaterial, Vector3, Vector4, type IUniform } from "three";
import { gridSpacing } from "./grid";
import type { Run, Vec, Wall } from "./run";
import { empty, polygon, shape, type Shape } from "./shapes";
import type { Shades } from "./theme";
import { add, basis, dot, scale } from "./vec";
import { glassFragment, outlineFragment, solidFragment, wallVertex } from "./walls.glsl";
import type { World } from "./world";

interface Moving {
  pose: number;
  to: Vector3;
  turn: Vector4;
  parts: Mesh[];
  /** When it is taken away, s. */
  until: number;
}

/** Relative to the time at which a wall is taken away: times of frames are rounded. */
const GONE = 1e-9;

export class Walls {
  readonly group = new Group();
  private readonly colours = {
    line: { value: new Color() },
    rim: { value: new Color() },
    ground: { value: new Color() },
    fill: { value: 0.05 },
  };
  private readonly moving: Moving[] = [];

  constructor(
    private readonly run: Run,
    world: World,
    shared: Record<string, IUniform>,
  ) {
    const reach = 0.75 * Math.hypot(...add(world.box[1], world.box[0], -1)) + 2 * world.size;
    for (const wall of run.walls) {
      const point = add(wall.point, run.origin, -1);
      const spacing = gridSpacing(world.size, reach);
      const made = wall.shape === "plane" ? sheet(wall, world, spacing) : shape(wall, nearest(wall, point, world), spacing, reach);
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(new Float32Array(made.position), 3));
      geometry.setAttribute("normal", new BufferAttribute(new Float32Array(made.normal), 3));
      geometry.setAttribute("mesh", new BufferAttribute(new Float32Array(made.mesh), 4));
      const to = new Vector3(...point);
      const turn = new Vector4(0, 0, 0, 1);
      const parts: Mesh[] = [];
      if (wall.pose !== undefined) this.moving.push({ pose: wall.pose, to, turn, parts, until: wall.until ?? Infinity });
      const uniforms = {
        ...shared,
        uFrom: { value: new Vector3(...point) },
        uTo: { value: to },
        uTurn: { value: turn },
        uLine: this.colours.line,
        uRim: this.colours.rim,
        uFloor: this.colours.ground,
        uFill: this.colours.fill,
      };
      const solid = wall.inside === false;
      if (solid) {
        parts.push(mesh(geometry, solidFragment, uniforms, 2, { side: DoubleSide, blending: NoBlending }));
      } else {
        parts.push(mesh(geometry, glassFragment, uniforms, 3, { side: FrontSide, depthWrite: false }));
        parts.push(mesh(geometry, outlineFragment, uniforms, 5, { side: BackSide, depthWrite: false }));
      }
      this.group.add(...parts);
    }
  }

  paint(shades: Shades): void {
    this.colours.line.value.set(shades.line);
    this.colours.rim.value.set(shades.rim);
    this.colours.ground.value.set(shades.ground);
    this.colours.fill.value = shades.pane;
  }

  /** Takes over the poses as sampled; what has been taken away is not shown. */
  update(): void {
    const { poses } = this.run;
    if (!poses) return;
    for (const { pose, to, turn, parts, until } of this.moving) {
      for (const part of parts) part.visible = this.run.now <= until * (1 + GONE);
      to.fromArray(poses.point as unknown as number[], 3 * pose);
      turn.fromArray(poses.turn as unknown as number[], 4 * pose);
    }
  }
}

function mesh(
  geometry: BufferGeometry,
  fragmentShader: string,
  uniforms: Record<string, IUniform>,
  order: number,
  how: Partial<RawShaderMaterial>,
): Mesh {
  const material = new RawShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: wallVertex,
    fragmentShader,
    uniforms,
    transparent: true, // see spheres.ts
  });
  Object.assign(material, how);
  const made = new Mesh(geometry, material);
  made.renderOrder = order;
  made.frustumCulled = false;
  return made;
}

/** A plane without end, as far as it is near the balls. */
function sheet(wall: Wall, world: World, spacing: number): Shape {
  const made = empty();
  const face = world.sheets.get(wall);
  if (face) polygon(made, face.corners, wall.axis!, basis(wall.axis!)[0], spacing);
  return made;
}

/** A tube without end is drawn around where the balls are. */
function nearest(wall: Wall, point: Vec, world: World): Vec {
  if (wall.shape !== "cylinder" || wall.length !== undefined) return point;
  const middle = scale(add(world.box[0], world.box[1]), 0.5);
  return add(point, wall.axis!, dot(wall.axis!, add(middle, point, -1)));
}
