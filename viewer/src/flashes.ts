// Impacts as rings that light up where balls meet and fade.

import {
  BufferAttribute,
  DynamicDrawUsage,
  GLSL3,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  RawShaderMaterial,
  type IUniform,
} from "three";
import type { Vec } from "./run";
import { QUAD } from "./spheres";
import type { Tint } from "./sticks";

export const MOST_FLASHES = 400;

export class Flashes {
  readonly mesh: Mesh<InstancedBufferGeometry, RawShaderMaterial>;
  private readonly place = new InstancedBufferAttribute(new Float32Array(4 * MOST_FLASHES), 4).setUsage(DynamicDrawUsage);
  private readonly glow = new InstancedBufferAttribute(new Float32Array(4 * MOST_FLASHES), 4).setUsage(DynamicDrawUsage);
  private count = 0;

  constructor(shared: Record<string, IUniform>, order: number) {
    const geometry = new InstancedBufferGeometry();
    geometry.setAttribute("corner", new BufferAttribute(QUAD, 2));
    geometry.setAttribute("place", this.place);
    geometry.setAttribute("glow", this.glow);
    geometry.setDrawRange(0, 6);
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      uniforms: shared,
      transparent: true,
      premultipliedAlpha: true,
      depthTest: false,
      depthWrite: false,
      vertexShader: `precision highp float;
        uniform mat4 viewMatrix; uniform mat4 projectionMatrix; uniform vec3 cameraPosition; uniform float uPixel;
        in vec2 corner; in vec4 place; in vec4 glow; out vec2 p; flat out vec4 vGlow;
        void main() {
          vec4 seen = viewMatrix * vec4(place.xyz, 1.0);
          float r = max(place.w, 9.0 * uPixel * distance(cameraPosition, place.xyz));
          seen.xy += r * corner;
          p = corner; vGlow = glow;
          gl_Position = projectionMatrix * seen;
        }`,
      // A ring that widens as it fades, around a core that is bright only at first.
      fragmentShader: `precision highp float; in vec2 p; flat in vec4 vGlow; out vec4 c;
        void main() {
          float left = vGlow.a; float d = length(p);
          float ring = 1.0 - smoothstep(0.0, 0.13, abs(d - mix(0.84, 0.38, left)));
          float core = left * left * (1.0 - smoothstep(0.0, 0.42, d));
          float a = clamp(left * ring + core, 0.0, 1.0);
          c = vec4(mix(vGlow.rgb, vec3(1.0), 0.7 * core) * a, a);
        }`,
    });
    this.mesh = new Mesh(geometry, material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = order;
  }

  clear(): void {
    this.count = 0;
  }

  /** `left` falls from 1 to 0 while it fades. The tint is as the screen has it, sRGB. */
  put(at: Vec, radius: number, tint: Tint, left: number): void {
    if (this.count === MOST_FLASHES) return;
    this.place.array.set([...at, radius], 4 * this.count);
    this.glow.array.set([...tint, left], 4 * this.count);
    this.count++;
  }

  done(): void {
    this.mesh.geometry.instanceCount = this.count;
    this.mesh.visible = this.count > 0;
    this.place.needsUpdate = this.glow.needsUpdate = true;
  }
}
