// All balls as one instanced draw; positions and attitudes are the run's own arrays, uploaded as they are.

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
} from "three";
import type { Look } from "./palette";
import type { Run } from "./run";
import { sphereFragment, sphereVertex } from "./spheres.glsl";

export const QUAD = new Float32Array([-1, -1, 1, -1, 1, 1, -1, -1, 1, 1, -1, 1]);

export class Spheres {
  readonly mesh: Mesh<InstancedBufferGeometry, RawShaderMaterial>;
  readonly centre: InstancedBufferAttribute;
  private readonly attitude: InstancedBufferAttribute;

  constructor(run: Run, looks: Look[], shared: Record<string, IUniform>) {
    const geometry = new InstancedBufferGeometry();
    geometry.setAttribute("corner", new BufferAttribute(QUAD, 2));
    this.centre = new InstancedBufferAttribute(run.centre, 4).setUsage(DynamicDrawUsage);
    this.attitude = new InstancedBufferAttribute(run.attitude, 4).setUsage(DynamicDrawUsage);
    geometry.setAttribute("centre", this.centre);
    geometry.setAttribute("attitude", this.attitude);
    const labels = [...new Set(looks.map((look) => look.label))];
    const look = new Float32Array(4 * run.count);
    const badge = new Float32Array(2 * run.count);
    looks.forEach((l, n) => {
      look.set([...l.colour, l.kind], 4 * n);
      badge.set([labels.indexOf(l.label), n], 2 * n);
    });
    geometry.setAttribute("look", new InstancedBufferAttribute(look, 4));
    geometry.setAttribute("badge", new InstancedBufferAttribute(badge, 2));
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

  update(): void {
    this.centre.needsUpdate = true;
    this.attitude.needsUpdate = true;
  }
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
