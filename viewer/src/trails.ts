// The ways of the balls: ribbons of constant width on the screen. They lie on the GPU as a whole; the shader draws the
// part that belongs to the time shown, so playing costs nothing.

import {
  BufferAttribute,
  GLSL3,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  RawShaderMaterial,
  type IUniform,
  Vector2,
} from "three";
import type { Look } from "./palette";
import { MOST_NUMBERED } from "./palette";
import { shiftOf } from "./periodic";
import type { Run } from "./run";
import { QUAD } from "./spheres";

export type TrailLength = "off" | "recent" | "whole";

/** Of more bodies only the way of the selected one is laid out. */
const MOST_TRAILED = 2000;
const RECENT = 0.08; // of the run
const TOLERANCE = 0.05; // of a radius: how far a ribbon may be from where the ball was, at the same time
const LONGEST = 64; // frames that one piece may bridge

export class Trails {
  readonly mesh: Mesh<InstancedBufferGeometry, RawShaderMaterial>;
  length: TrailLength = "off";
  private laidOut: number | "all" | undefined;

  constructor(
    private readonly run: Run,
    private readonly looks: Look[],
    shared: Record<string, IUniform>,
  ) {
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: VERTEX,
      fragmentShader: `precision highp float; in vec4 shade; out vec4 c; void main() { c = vec4(shade.rgb * shade.a, shade.a); }`,
      transparent: true,
      premultipliedAlpha: true,
      depthWrite: false,
      uniforms: {
        ...shared,
        uTime: { value: 0 },
        uWindow: { value: 1 },
        uFaint: { value: 0 },
        uOnly: { value: -1 },
        uViewport: { value: new Vector2(1, 1) },
      },
    });
    this.mesh = new Mesh(new InstancedBufferGeometry(), material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 4.5;
    this.mesh.visible = false;
  }

  /** `viewport` in pixels of the device. */
  update(selected: number, width: number, height: number): void {
    const { run, mesh } = this;
    const many = run.count > MOST_NUMBERED;
    const only = many && selected >= 0 ? selected : -1;
    mesh.visible = this.length !== "off" && run.frames > 1 && (run.count <= MOST_TRAILED || only >= 0);
    if (!mesh.visible) return;
    const wanted = run.count <= MOST_TRAILED ? "all" : only;
    if (this.laidOut !== wanted) this.layOut(wanted);
    const { uTime, uWindow, uFaint, uOnly, uViewport } = mesh.material.uniforms;
    const span = run.end - run.start;
    uTime.value = run.now - run.start;
    uWindow.value = this.length === "whole" ? 1.001 * span : RECENT * span;
    uFaint.value = this.length === "whole" ? (many && only < 0 ? 0.12 : 0.5) : 0;
    uOnly.value = only;
    uViewport.value.set(width, height);
  }

  private layOut(wanted: "all" | number): void {
    const { run } = this;
    const from: number[] = [];
    const to: number[] = [];
    const when: number[] = [];
    const tint: number[] = [];
    const bodies = wanted === "all" ? run.names.map((_, n) => n) : [wanted];
    for (const n of bodies) {
      const look = this.looks[n];
      pieces(run, n, (a, b, p, q) => {
        from.push(...p);
        to.push(...q);
        when.push(run.time[a] - run.start, run.time[b] - run.start);
        tint.push(...screen(look.css), n);
      });
    }
    const geometry = new InstancedBufferGeometry();
    geometry.setAttribute("corner", new BufferAttribute(QUAD, 2));
    const attribute = (name: string, values: number[], size: number) =>
      geometry.setAttribute(name, new InstancedBufferAttribute(new Float32Array(values), size));
    attribute("from", from, 3);
    attribute("to", to, 3);
    attribute("when", when, 2);
    attribute("tint", tint, 4);
    geometry.setDrawRange(0, 6);
    geometry.instanceCount = when.length / 2;
    this.mesh.geometry.dispose();
    this.mesh.geometry = geometry;
    this.laidOut = wanted;
  }
}

type Piece = (a: number, b: number, p: [number, number, number], q: [number, number, number]) => void;

/** Cuts a body's way into straight pieces of even speed, as few as the tolerance allows. */
function pieces(run: Run, n: number, piece: Piece): void {
  const { frames, time } = run;
  const way = new Float64Array(3 * frames);
  for (let f = 0; f < frames; f++) run.centreAt(f, n, way.subarray(3 * f, 3 * f + 3));
  const tolerance = (TOLERANCE * run.radius[n]) ** 2;
  const fits = (a: number, b: number) => {
    const span = time[b] - time[a];
    for (let f = a + 1; f < b; f++) {
      const s = span > 0 ? (time[f] - time[a]) / span : 0;
      let off = 0;
      for (let k = 0; k < 3; k++) off += (way[3 * f + k] - way[3 * a + k] - s * (way[3 * b + k] - way[3 * a + k])) ** 2;
      if (off > tolerance) return false;
    }
    return true;
  };
  const at = (f: number, k: number) => way[3 * f + k];
  for (let a = 0; a < frames - 1; ) {
    let b = a + 1;
    const whole = run.present(n, a) && run.present(n, b);
    while (whole && b + 1 < frames && b + 1 - a <= LONGEST && run.present(n, b + 1) && fits(a, b + 1)) b++;
    // A ball at rest leaves no trail.
    const moved = [0, 1, 2].some((k) => Math.abs(at(b, k) - at(a, k)) > 1e-3 * run.radius[n]);
    if (whole && moved) {
      // In a periodic world a piece lies in the period in which it begins.
      const shift: [number, number, number] = [0, 0, 0];
      if (run.boxes) shiftOf(run.boxes.at(a, a, 0), [0, 1, 2].map((k) => at(a, k) + run.origin[k]), shift);
      const point = (f: number) => [0, 1, 2].map((k) => at(f, k) - shift[k]) as [number, number, number];
      piece(a, b, point(a), point(b));
    }
    a = b;
  }
}

function screen(css: string): [number, number, number] {
  return [1, 3, 5].map((i) => parseInt(css.slice(i, i + 2), 16) / 255) as [number, number, number];
}

const VERTEX = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform float uTime;      // since the start of the run
uniform float uWindow;    // how long ago a trail begins
uniform float uFaint;     // what is left of it there
uniform float uOnly;      // the one body whose trail is drawn, or -1
uniform float uDay;
uniform vec2 uViewport;
in vec2 corner;
in vec3 from;
in vec3 to;
in vec2 when;
in vec4 tint;             // sRGB, body
out vec4 shade;
void main() {
  float span = max(when.y - when.x, 1e-30);
  vec2 part = clamp((vec2(uTime - uWindow, uTime) - when.x) / span, 0.0, 1.0);
  bool drawn = part.y > part.x && (uOnly < -0.5 || abs(uOnly - tint.w) < 0.5);
  mat4 onto = projectionMatrix * viewMatrix;
  vec4 p = onto * vec4(mix(from, to, part.x), 1.0);
  vec4 q = onto * vec4(mix(from, to, part.y), 1.0);
  // What is behind the eye is cut off, or the ribbon would turn over.
  float near = 1e-4 * max(abs(p.w), abs(q.w));
  if (!drawn || max(p.w, q.w) <= near) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    shade = vec4(0.0);
    return;
  }
  if (p.w < near) p = mix(p, q, (near - p.w) / (q.w - p.w));
  if (q.w < near) q = mix(q, p, (near - q.w) / (p.w - q.w));
  vec2 along = (q.xy / q.w - p.xy / p.w) * uViewport;
  along = length(along) > 1e-6 ? normalize(along) : vec2(1.0, 0.0);
  vec4 end = corner.x < 0.0 ? p : q;
  float width = 0.0032 * min(uViewport.x, uViewport.y);
  end.xy += (vec2(-along.y, along.x) * corner.y * width + along * corner.x * 0.5 * width) / uViewport * end.w;
  float age = clamp((uTime - mix(when.x, when.y, corner.x < 0.0 ? part.x : part.y)) / uWindow, 0.0, 1.0);
  vec3 c = tint.rgb;
  // Dark balls on a dark ground, light ones on a light one: keep apart from what is behind.
  c = uDay > 0.5 ? c * 0.85 : mix(c, vec3(1.0), 0.25);
  shade = vec4(c, mix(1.0, uFaint, age));
  gl_Position = end;
}
`;
