// All balls as one instanced draw, the nearest first: what they hide is then never shaded.

import {
  CanvasTexture,
  DynamicDrawUsage,
  GLSL3,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  BufferAttribute,
  LinearMipmapLinearFilter,
  Mesh,
  NoBlending,
  RawShaderMaterial,
  type IUniform,
  type Vector3,
} from "three";
import type { Look } from "./palette";
import type { Run } from "./run";
import { sphereFragment, sphereVertex } from "./spheres.glsl";

export const QUAD = new Float32Array([-1, -1, 1, -1, 1, 1, -1, -1, 1, 1, -1, 1]);

export class Spheres {
  readonly mesh: Mesh<InstancedBufferGeometry, RawShaderMaterial>;
  readonly centre: InstancedBufferAttribute;
  private readonly attitude: InstancedBufferAttribute;
  private readonly look: InstancedBufferAttribute;
  private readonly badge: InstancedBufferAttribute;
  private readonly looksOf: Float32Array;
  private readonly badgesOf: Float32Array;
  /** Bodies from near to far, and how far each is. */
  private readonly order: number[];
  private readonly away: Float64Array;

  constructor(
    private readonly run: Run,
    looks: Look[],
    shared: Record<string, IUniform>,
  ) {
    const geometry = new InstancedBufferGeometry();
    geometry.setAttribute("corner", new BufferAttribute(QUAD, 2));
    const attribute = (name: string, size: number) => {
      const made = new InstancedBufferAttribute(new Float32Array(size * run.count), size).setUsage(DynamicDrawUsage);
      geometry.setAttribute(name, made);
      return made;
    };
    this.centre = attribute("centre", 4);
    this.attitude = attribute("attitude", 4);
    this.look = attribute("look", 4);
    this.badge = attribute("badge", 2);
    const labels = [...new Set(looks.map((look) => look.label))];
    this.looksOf = new Float32Array(looks.flatMap((l) => [...l.colour, l.kind]));
    this.badgesOf = new Float32Array(looks.flatMap((l, n) => [labels.indexOf(l.label), n]));
    this.order = looks.map((_, n) => n);
    this.away = new Float64Array(run.count);
    geometry.instanceCount = run.count;
    geometry.setDrawRange(0, 6); // there is no "position" to count
    const side = Math.max(1, Math.ceil(Math.sqrt(labels.length)));
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: sphereVertex,
      fragmentShader: sphereFragment,
      uniforms: {
        ...shared,
        uNumbers: { value: numbers(labels, side) },
        uAtlas: { value: side },
        uSelected: { value: -1 },
        uSolid: { value: 1 },
        uCoarse: { value: 0 },
      },
    });
    material.alphaToCoverage = true; // smooth outlines without sorting
    // Nothing here blends, but three.js draws what is "transparent" last: with all of it called so,
    // renderOrder alone decides, and shadows fall between the floor and the balls.
    material.transparent = true;
    material.blending = NoBlending;
    this.mesh = new Mesh(geometry, material);
    this.mesh.frustumCulled = false; // the quads' place is known to the shader only
    this.mesh.renderOrder = 4;
  }

  select(body: number): void {
    this.mesh.material.uniforms.uSelected.value = body;
  }

  /** Takes over the run as sampled, sorted as seen from `eye`; `through`: balls let through what is behind them. */
  update(eye: Vector3, through: boolean, coarse: boolean): void {
    this.mesh.material.uniforms.uCoarse.value = coarse ? 1 : 0;
    this.mesh.material.uniforms.uSolid.value = through ? 0.25 : 1; // one of four samples of a pixel
    const { centre, attitude } = this.run;
    const { order, away } = this;
    for (const n of order) {
      const x = centre[4 * n] - eye.x;
      const y = centre[4 * n + 1] - eye.y;
      const z = centre[4 * n + 2] - eye.z;
      away[n] = x * x + y * y + z * z - centre[4 * n + 3] ** 2;
    }
    // Nearly in order already, which the sort makes use of. Differences would be made into objects.
    order.sort((a, b) => (away[a] < away[b] ? -1 : away[a] > away[b] ? 1 : 0));
    gather(this.centre, centre, order);
    gather(this.attitude, attitude, order);
    gather(this.look, this.looksOf, order);
    gather(this.badge, this.badgesOf, order);
  }
}

function gather(into: InstancedBufferAttribute, from: Float32Array, order: number[]): void {
  const { array, itemSize } = into;
  for (let i = 0, at = 0; i < order.length; i++) {
    for (let k = 0; k < itemSize; k++) array[at++] = from[itemSize * order[i] + k];
  }
  into.needsUpdate = true;
}

/** The numbers, drawn once, each in its cell of a square atlas. */
function numbers(labels: string[], side: number): CanvasTexture {
  const cell = side > 4 ? 64 : 128;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = cell * side;
  const pen = canvas.getContext("2d")!;
  pen.fillStyle = "#000";
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.fillStyle = "#fff";
  pen.textAlign = "center";
  pen.textBaseline = "alphabetic";
  labels.forEach((label, i) => {
    const size = cell * (label.length > 2 ? 0.44 : label.length > 1 ? 0.6 : 0.74);
    pen.font = `700 ${size}px "Helvetica Neue", Arial, sans-serif`;
    const x = (i % side) * cell + cell / 2;
    const y = canvas.height - Math.floor(i / side) * cell - cell / 2; // textures count rows from below
    pen.fillText(label, x, y + 0.36 * size);
    if (label === "6" || label === "9") pen.fillRect(x - 0.26 * size, y + 0.46 * size, 0.52 * size, 0.07 * size);
  });
  const texture = new CanvasTexture(canvas);
  texture.minFilter = LinearMipmapLinearFilter;
  texture.anisotropy = 4;
  return texture;
}
