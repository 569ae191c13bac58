// Meshes of what world.ts laid out: floors with their shadows, rims, glazed walls.

import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DoubleSide,
  FrontSide,
  GLSL3,
  Group,
  InstancedBufferGeometry,
  Mesh,
  NoBlending,
  RawShaderMaterial,
  Vector3,
  Vector4,
  type IUniform,
} from "three";
import type { InstancedBufferAttribute } from "three";
import { floorFragment, floorVertex, shadowFragment, shadowVertex } from "./floor.glsl";
import { paneFragment, rimFragment, rimVertex } from "./rims.glsl";
import { gridSpacing } from "./grid";
import { MOST_NUMBERED } from "./palette";
import type { Run, Vec } from "./run";
import { QUAD } from "./spheres";
import { KitTable, type TableColours } from "./table";
import type { Shades } from "./theme";
import { add, basis, dot, scale } from "./vec";
import type { Face, World } from "./world";

const EDGES = 8; // of a face, in the shaders; more are not drawn exactly
const vector = (v: Vec) => new Vector3(...v);

export class Surfaces {
  readonly group = new Group();
  private readonly colours = {
    cloth: { value: new Color() },
    wood: { value: new Color() },
    line: { value: new Color() },
    strength: { value: 1 },
    fill: { value: 0.05 },
  };
  private readonly undersides: { face: Face; shadow: Mesh }[] = [];

  private readonly kit: KitTable | undefined;

  constructor(
    run: Run,
    private readonly world: World,
    centre: InstancedBufferAttribute,
    shared: Record<string, IUniform>,
    lamp: Vector3,
  ) {
    if (run.table && run.facts.table) {
      this.kit = new KitTable(run.table, run.facts.table, run.origin, shared);
      this.group.add(this.kit.mesh);
    }
    for (const floor of world.floors) {
      this.group.add(this.floor(floor, shared));
      const shadow = this.shadow(floor, centre, lamp);
      this.group.add(shadow);
      this.undersides.push({ face: floor, shadow });
      const rim = this.rim(floor, shared);
      if (rim) this.group.add(rim);
    }
    for (const pane of world.panes) this.group.add(this.pane(pane));
  }

  paint(shades: Shades, colours: TableColours): void {
    const { cloth, wood, line, strength, fill } = this.colours;
    cloth.value.set(this.world.table ? colours.cloth : shades.ground);
    wood.value.set(this.world.table ? colours.wood : shades.rim);
    this.kit?.paint(colours);
    line.value.set(shades.line);
    strength.value = shades.shadow;
    fill.value = shades.pane;
  }

  /** Shadows lie on top of a floor; from below there is nothing to see them on. */
  lookFrom(eye: Vector3, coarse: boolean): void {
    for (const { face, shadow } of this.undersides) shadow.visible = !coarse && vector(face.plane.normal).dot(eye) > face.offset;
  }

  private floor(face: Face, shared: Record<string, IUniform>): Mesh {
    const [u, v] = basis(face.plane.normal);
    const middle = scale(face.corners.reduce((a, b) => add(a, b)), 1 / face.corners.length);
    const reach = Math.max(...face.corners.map((c) => Math.hypot(...add(c, middle, -1))));
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: floorVertex,
      fragmentShader: floorFragment,
      side: FrontSide, // from below one sees the balls
      transparent: true,
      premultipliedAlpha: true,
      uniforms: {
        ...shared,
        ...edges(face),
        uU: { value: vector(u) },
        uV: { value: vector(v) },
        uNormal: { value: vector(face.plane.normal) },
        uMiddle: { value: vector(middle) },
        uReach: { value: reach },
        uSize: { value: this.world.size },
        uGrid: { value: this.world.table ? 0 : gridSpacing(this.world.size, reach) },
        uColour: this.colours.cloth,
        uLine: this.colours.line,
      },
    });
    return ordered(new Mesh(this.kit?.cloth ?? polygon(face), material), 0);
  }

  private shadow(face: Face, centre: InstancedBufferAttribute, lamp: Vector3): Mesh {
    const geometry = new InstancedBufferGeometry();
    geometry.setAttribute("corner", new BufferAttribute(QUAD, 2));
    geometry.setAttribute("centre", centre);
    geometry.setDrawRange(0, 6);
    geometry.instanceCount = centre.count;
    const [u, v] = basis(face.plane.normal);
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: shadowVertex,
      fragmentShader: shadowFragment,
      transparent: true,
      depthTest: false, // drawn right after its floor and before all that stands on it
      depthWrite: false,
      uniforms: {
        ...edges(face),
        uU: { value: vector(u) },
        uV: { value: vector(v) },
        uPlane: { value: new Vector4(...face.plane.normal, face.offset) },
        uLamp: { value: lamp },
        // In a heap only the lowest layer shades the floor: the rest would darken it all, at great cost.
        uTallest: { value: centre.count > MOST_NUMBERED ? 2.2 : 14 },
        uStrength: this.colours.strength,
      },
    });
    return ordered(new Mesh(geometry, material), 1);
  }

  /** A profile swept along the walled edges, mitred where two meet. */
  private rim(face: Face, shared: Record<string, IUniform>): Mesh | undefined {
    if (this.kit) return undefined;
    const r = this.world.size;
    // Distance out, height, material of the strip that ends here (0 cloth, 1 wood); the nose is at the wall.
    const profile: [number, number, number][] = this.world.table
      ? [[0, 0, 0], [0.35, 0.01, 0], [0, 0.9, 0], [0, 1.2, 0], [0.25, 1.36, 0], [1.8, 1.5, 0], [1.8, 1.55, 1], [4.7, 1.55, 1], [5.0, 1.4, 1], [5.1, 1.1, 1], [5.1, -2.2, 1]]
      : [[0, 0, 1], [0, 0.8, 1], [0.45, 0.8, 1], [0.45, -0.3, 1]];
    const at: number[] = [];
    const normals: number[] = [];
    const strips: number[] = [];
    const count = face.corners.length;
    face.edges.forEach((edge, i) => {
      if (!edge.wall) return;
      const ends = [i, (i + 1) % count].map((k) => this.mitre(face, k, i));
      const along = add(face.corners[(i + 1) % count], face.corners[i], -1);
      const length = Math.hypot(...along);
      const direction = scale(along, 1 / length);
      for (let k = 1; k < profile.length; k++) {
        const [d0, h0] = profile[k - 1];
        const [d1, h1, material] = profile[k];
        const corner = (end: number, d: number, h: number) =>
          add(add(face.corners[(i + end) % count], ends[end], d * r), face.plane.normal, h * r);
        const slope = Math.hypot(d1 - d0, h1 - h0);
        const normal = add(scale(face.plane.normal, (d1 - d0) / slope), edge.out, -(h1 - h0) / slope);
        const quad: [number, number, number][] = [[0, d0, h0], [1, d0, h0], [1, d1, h1], [0, d0, h0], [1, d1, h1], [0, d1, h1]];
        for (const [end, d, h] of quad) {
          const p = corner(end, d, h);
          at.push(...p);
          normals.push(...normal);
          strips.push(dot(add(p, face.corners[i], -1), direction), length, d * r, material);
        }
      }
    });
    if (at.length === 0) return undefined;
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(at), 3));
    geometry.setAttribute("normal", new BufferAttribute(new Float32Array(normals), 3));
    geometry.setAttribute("strip", new BufferAttribute(new Float32Array(strips), 4));
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: rimVertex,
      fragmentShader: rimFragment,
      side: DoubleSide,
      transparent: true, // see spheres.ts
      blending: NoBlending,
      uniforms: {
        ...shared,
        uCloth: this.colours.cloth,
        uWood: this.colours.wood,
        uSize: { value: r },
        uSights: { value: this.world.table ? 3.3 * r : 0 },
      },
    });
    return ordered(new Mesh(geometry, material), 2);
  }

  /** Where a profile at distance one stands at this corner, for the rim along `edge`. */
  private mitre(face: Face, corner: number, edge: number): Vec {
    const count = face.corners.length;
    const before = face.edges[(corner + count - 1) % count];
    const after = face.edges[corner];
    if (!before.wall || !after.wall) return face.edges[edge].out;
    return scale(add(before.out, after.out), 1 / (1 + dot(before.out, after.out)));
  }

  private pane(face: Face): Mesh {
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: floorVertex,
      fragmentShader: paneFragment,
      side: FrontSide, // the walls between us and the balls are not drawn
      transparent: true,
      depthWrite: false,
      uniforms: { ...edges(face), uLine: this.colours.line, uFill: this.colours.fill, uSize: { value: this.world.size } },
    });
    return ordered(new Mesh(polygon(face), material), 3);
  }
}

function ordered(mesh: Mesh, order: number): Mesh {
  mesh.renderOrder = order;
  mesh.frustumCulled = false;
  return mesh;
}

function polygon(face: Face): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(face.corners.flat()), 3));
  geometry.setIndex(face.corners.slice(2).flatMap((_, i) => [0, i + 1, i + 2]));
  return geometry;
}

function edges(face: Face): Record<string, IUniform> {
  const lines = face.edges.slice(0, EDGES).map(({ out }, i) => new Vector4(-out[0], -out[1], -out[2], dot(out, face.corners[i])));
  const walls = face.edges.slice(0, EDGES).map(({ wall }) => (wall ? 1 : 0));
  const count = lines.length;
  while (lines.length < EDGES) lines.push(new Vector4());
  while (walls.length < EDGES) walls.push(0);
  return { uEdges: { value: lines }, uWalls: { value: walls }, uEdgeCount: { value: count } };
}
