// Many arrows and rods as one instanced draw; filled anew for each picture.

import {
  BufferAttribute,
  DynamicDrawUsage,
  FrontSide,
  GLSL3,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  NoBlending,
  RawShaderMaterial,
  type IUniform,
} from "three";
import type { Vec } from "./run";
import { stickFragment, stickVertex } from "./sticks.glsl";

const SIDES = 8;
const RINGS = 6; // back of the shaft, shaft from and to, back of the head, head from and to

export type Tint = [number, number, number];

export class Sticks {
  readonly mesh: Mesh<InstancedBufferGeometry, RawShaderMaterial>;
  private tail = new Float32Array(0);
  private tip = new Float32Array(0);
  private tint = new Float32Array(0);
  private count = 0;

  constructor(shared: Record<string, IUniform>, order: number) {
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: stickVertex,
      fragmentShader: stickFragment,
      uniforms: shared,
      side: FrontSide,
      transparent: true, // see spheres.ts
      blending: NoBlending,
    });
    this.mesh = new Mesh(prism(), material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = order;
    this.grow(64);
  }

  clear(): void {
    this.count = 0;
  }

  /** From `at` by `way`; thinner where it is short, so that a short arrow is still one. */
  arrow(at: Vec, way: Vec, radius: number, tint: Tint): void {
    this.put(at, at[0] + way[0], at[1] + way[1], at[2] + way[2], radius, tint, 1);
  }

  rod(from: Vec, to: Vec, radius: number, tint: Tint): void {
    this.put(from, to[0], to[1], to[2], radius, tint, 0);
  }

  /** Hands over what was put since `clear`. */
  done(): void {
    const { geometry } = this.mesh;
    geometry.instanceCount = this.count;
    this.mesh.visible = this.count > 0;
    for (const name of ["tail", "tip", "tint"]) {
      const attribute = geometry.getAttribute(name) as InstancedBufferAttribute;
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, this.count * attribute.itemSize);
      attribute.needsUpdate = true;
    }
  }

  private put(from: Vec, x: number, y: number, z: number, radius: number, tint: Tint, head: number): void {
    if (from[0] === x && from[1] === y && from[2] === z) return;
    if (4 * this.count === this.tail.length) this.grow(2 * this.count);
    const at = 4 * this.count;
    for (let k = 0; k < 3; k++) {
      this.tail[at + k] = from[k];
      this.tint[3 * this.count + k] = tint[k];
    }
    this.tip[at] = x;
    this.tip[at + 1] = y;
    this.tip[at + 2] = z;
    this.tail[at + 3] = radius;
    this.tip[at + 3] = head;
    this.count++;
  }

  private grow(room: number): void {
    const { geometry } = this.mesh;
    const larger = (name: string, before: Float32Array<ArrayBuffer>, size: number) => {
      const array = new Float32Array(size * room);
      array.set(before);
      geometry.setAttribute(name, new InstancedBufferAttribute(array, size).setUsage(DynamicDrawUsage));
      return array;
    };
    this.tail = larger("tail", this.tail, 4);
    this.tip = larger("tip", this.tip, 4);
    this.tint = larger("tint", this.tint, 3);
  }
}

function prism(): InstancedBufferGeometry {
  const geometry = new InstancedBufferGeometry();
  const corner = new Float32Array(3 * SIDES * RINGS);
  for (let part = 0; part < RINGS; part++) {
    for (let i = 0; i < SIDES; i++) {
      const angle = (2 * Math.PI * i) / SIDES;
      corner.set([Math.cos(angle), Math.sin(angle), part], 3 * (part * SIDES + i));
    }
  }
  const index: number[] = [];
  const ring = (part: number, i: number) => part * SIDES + (i % SIDES);
  for (const part of [0, 3]) {
    for (let i = 1; i < SIDES - 1; i++) index.push(ring(part, 0), ring(part, i + 1), ring(part, i));
  }
  for (const [low, high] of [[1, 2], [4, 5]]) {
    for (let i = 0; i < SIDES; i++) {
      index.push(ring(low, i), ring(low, i + 1), ring(high, i));
      index.push(ring(low, i + 1), ring(high, i + 1), ring(high, i));
    }
  }
  geometry.setAttribute("corner", new BufferAttribute(corner, 3));
  geometry.setIndex(index);
  return geometry;
}
