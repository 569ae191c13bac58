// The picture: one WebGL canvas, drawn when something changed and not otherwise.

import {
  Color,
  GLSL3,
  LinearSRGBColorSpace,
  Mesh,
  NoBlending,
  PlaneGeometry,
  RawShaderMaterial,
  Scene,
  Vector3,
  Vector4,
  WebGLRenderer,
} from "three";
import { Eye } from "./camera";
import { Overlay } from "./overlay";
import { looks, MOST_NUMBERED, type Look } from "./palette";
import type { Run, Vec } from "./run";
import { Spheres } from "./spheres";
import { Surfaces } from "./surfaces";
import { tableColours } from "./table";
import type { Shades } from "./theme";
import { cross, scale } from "./vec";
import { Walls } from "./walls";
import { layOut, type World } from "./world";

const COARSE = 0.7; // below this sharpness a crowd is drawn without mirror images and shadows
const SLOW_MS = 45; // a picture that takes longer is drawn coarser while playing

export class Stage {
  readonly world: World;
  readonly looks: Look[];
  readonly eye: Eye;
  readonly canvas: HTMLCanvasElement;
  dirty = true;
  readonly overlay: Overlay;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly spheres: Spheres;
  private readonly surfaces: Surfaces;
  private readonly walls: Walls;
  private readonly back: Mesh<PlaneGeometry, RawShaderMaterial>;
  private readonly shared;
  /** Share of the screen's resolution that is drawn. */
  sharpness = 1;
  private selected = -1;
  private hold = 0;
  private cost = 0;

  constructor(
    private readonly run: Run,
    private readonly host: HTMLElement,
  ) {
    this.world = layOut(run);
    this.looks = looks(run);
    this.renderer = new WebGLRenderer({ antialias: true, alpha: false, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = LinearSRGBColorSpace; // our shaders write sRGB themselves
    this.canvas = this.renderer.domElement;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", "Balls and walls at the time shown");
    host.append(this.canvas);
    const { up, across, floors, size } = this.world;
    const floor = floors[0];
    this.shared = {
      uUp: { value: new Vector3(...up) },
      uAcross: { value: new Vector3(...across) },
      uDay: { value: 1 },
      uGround: { value: floor ? new Vector4(...floor.plane.normal, floor.offset) : new Vector4(...up, -1e6 * size) },
      uGroundColour: { value: new Color(0.3, 0.3, 0.3) },
      uAccent: { value: new Color() },
      uPixel: { value: 1e-3 },
    };
    // The same direction as lampDirection() in light.glsl.ts.
    const forward = cross(up, across);
    const lamp = new Vector3(...up).addScaledVector(new Vector3(...forward), 0.22).addScaledVector(new Vector3(...scale(across, -1)), 0.3);
    this.spheres = new Spheres(run, this.looks, this.shared);
    this.surfaces = new Surfaces(run, this.world, this.spheres.centre, this.shared, lamp.normalize());
    this.walls = new Walls(run, this.world, this.shared);
    this.back = backdrop();
    this.overlay = new Overlay(run, this.world, this.looks, this.shared);
    this.scene.add(this.back, this.surfaces.group, this.walls.group, this.spheres.mesh, this.overlay.among);
    this.eye = new Eye(run, this.world, this.canvas, () => (this.dirty = true), () => {
      const { offsetLeft: left, offsetTop: top, offsetWidth: width, offsetHeight: height } = host.querySelector("header")!;
      return { right: (left + width) / host.clientWidth, bottom: (top + height) / host.clientHeight };
    });
    this.canvas.addEventListener("webglcontextrestored", () => (this.dirty = true));
    new ResizeObserver(() => this.resize()).observe(host);
    this.resize();
  }

  paint(shades: Shades): void {
    this.shared.uDay.value = shades.day;
    const colours = tableColours(this.run, shades);
    this.shared.uGroundColour.value.set(this.world.table ? colours.cloth : shades.ground);
    this.shared.uAccent.value.set(shades.accent);
    this.back.material.uniforms.uMiddle.value.set(shades.back[0]).convertLinearToSRGB();
    this.back.material.uniforms.uRim.value.set(shades.back[1]).convertLinearToSRGB();
    this.surfaces.paint(shades, colours);
    this.walls.paint(shades);
    this.dirty = true;
  }

  select(body: number): void {
    this.selected = body;
    this.spheres.select(body);
    this.dirty = true;
  }

  /**
   * Draws the run as sampled; impacts flash for `hold` seconds of it. Returns true while another picture is due even if
   * nothing else changes.
   */
  draw(moving: boolean, hold: number): boolean {
    this.dirty = false;
    this.hold = hold;
    this.adapt(moving);
    const gliding = this.eye.update();
    const { shown } = this.overlay;
    const coarse = this.sharpness < COARSE && this.run.count > MOST_NUMBERED;
    this.spheres.update(this.eye.camera.position, shown.through, coarse);
    this.walls.update();
    this.surfaces.lookFrom(this.eye.camera.position, coarse);
    this.overlay.update(this.selected, hold, this.canvas.width, this.canvas.height);
    this.render();
    return gliding;
  }

  /** The picture as it stands, `times` as sharp (within what the machine can draw), on a canvas of its own. */
  picture(times: number): HTMLCanvasElement {
    const ratio = this.renderer.getPixelRatio();
    const longest = Math.max(this.host.clientWidth, this.host.clientHeight);
    const wanted = Math.min(times * Math.min(devicePixelRatio, 2), this.renderer.capabilities.maxTextureSize / longest, 8192 / longest);
    this.renderer.setPixelRatio(wanted);
    this.overlay.update(this.selected, this.hold, this.canvas.width, this.canvas.height);
    this.render();
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [this.canvas.width, this.canvas.height];
    copy.getContext("2d")!.drawImage(this.canvas, 0, 0); // in the same task, before the browser clears it
    this.renderer.setPixelRatio(ratio);
    this.dirty = true;
    return copy;
  }

  private render(): void {
    const { renderer, eye } = this;
    const pixels = this.canvas.height || 1;
    this.shared.uPixel.value = (2 * Math.tan((eye.camera.fov * Math.PI) / 360)) / pixels;
    renderer.autoClear = true;
    renderer.render(this.scene, eye.camera);
    if (this.overlay.onTop.children.every((mesh) => !mesh.visible)) return;
    renderer.autoClear = false;
    renderer.clearDepth();
    renderer.render(this.overlay.onTop, eye.camera);
  }

  /** Feedback from the loop: seconds between pictures while playing. */
  pace(interval: number): void {
    this.cost = 0.85 * this.cost + 0.15 * 1000 * interval;
  }

  /** The frontmost ball under a point of the canvas, in CSS pixels; -1 for none. */
  pick(x: number, y: number): number {
    const { height } = this.canvas.getBoundingClientRect();
    const eye = this.eye.camera.position;
    const ray = this.ray(x, y);
    let best = Infinity;
    let body = -1;
    const centre = new Vector3();
    for (let n = 0; n < this.run.count; n++) {
      if (!this.run.present(n)) continue;
      const along = centre.fromArray(this.run.centre, 4 * n).sub(eye).dot(ray);
      const miss = centre.addScaledVector(ray, -along).length();
      // A few pixels of grace: small balls and thumbs.
      const grace = (4 * along * Math.tan((this.eye.camera.fov * Math.PI) / 360)) / height;
      if (along > 0 && along < best && miss < this.run.radius[n] + grace) [best, body] = [along, n];
    }
    return body;
  }

  /** CSS pixels of a point given relative to run.origin; undefined behind the eye. */
  project(at: Vec): [number, number] | undefined {
    const p = new Vector3(...at).project(this.eye.camera);
    if (p.z > 1 || p.z < -1) return undefined;
    return [(0.5 + 0.5 * p.x) * this.host.clientWidth, (0.5 - 0.5 * p.y) * this.host.clientHeight];
  }

  /** The point of the plane through `at` (relative to run.origin, square to what is up) under a point of the canvas. */
  under(x: number, y: number, at: Vec): Vec | undefined {
    const eye = this.eye.camera.position;
    const up = new Vector3(...this.world.up);
    const ray = this.ray(x, y);
    const along = new Vector3(...at).sub(eye).dot(up) / ray.dot(up);
    return along > 0 ? (eye.clone().addScaledVector(ray, along).toArray() as Vec) : undefined;
  }

  /** The direction from the eye through a point of the canvas, in CSS pixels. */
  private ray(x: number, y: number): Vector3 {
    const { width, height } = this.canvas.getBoundingClientRect();
    const { camera } = this.eye;
    return new Vector3((2 * x) / width - 1, 1 - (2 * y) / height, 0.5).unproject(camera).sub(camera.position).normalize();
  }

  private resize(): void {
    const width = Math.max(1, this.host.clientWidth);
    const height = Math.max(1, this.host.clientHeight);
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2) * this.sharpness);
    this.renderer.setSize(width, height);
    this.eye.resize(width, height);
    this.dirty = true;
  }

  /** Coarser while a slow machine plays, sharp again when it stops. */
  private adapt(moving: boolean): void {
    const before = this.sharpness;
    if (!moving) [this.sharpness, this.cost] = [1, 0];
    else if (this.cost > SLOW_MS && this.sharpness > 0.45) [this.sharpness, this.cost] = [this.sharpness * 0.8, 0];
    if (this.sharpness !== before) {
      this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2) * this.sharpness);
      this.dirty = false;
    }
  }
}

function backdrop(): Mesh<PlaneGeometry, RawShaderMaterial> {
  const material = new RawShaderMaterial({
    glslVersion: GLSL3,
    transparent: true, // see spheres.ts
    blending: NoBlending,
    depthTest: false,
    depthWrite: false,
    uniforms: { uMiddle: { value: new Color() }, uRim: { value: new Color() } },
    vertexShader: `in vec3 position; out vec2 p; void main() { p = position.xy; gl_Position = vec4(position.xy, 0.0, 1.0); }`,
    fragmentShader: `precision highp float; uniform vec3 uMiddle; uniform vec3 uRim; in vec2 p; out vec4 c;
      void main() { c = vec4(mix(uMiddle, uRim, smoothstep(0.1, 1.5, length(p * vec2(0.9, 1.0) - vec2(0.0, 0.15)))), 1.0); }`,
  });
  const mesh = new Mesh(new PlaneGeometry(2, 2), material);
  mesh.frustumCulled = false;
  mesh.renderOrder = -1;
  return mesh;
}
