// The eye: orbiting by hand, three fixed views, and one that goes along with a ball.

import { MOUSE, PerspectiveCamera, TOUCH, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Run, Vec } from "./run";
import { add, cross, dot, scale, unit } from "./vec";
import { corners, type World } from "./world";

export type Preset = "fit" | "top" | "side" | "end";

interface Pose {
  eye: Vector3;
  target: Vector3;
}

const GLIDE_MS = 450;
const MARGIN = 1.05; // around the box, of its size
const MOST_FREE = 0.4; // of the height is left to titles, even if they need more

export class Eye {
  readonly camera = new PerspectiveCamera(32, 1, 0.01, 100);
  readonly controls: OrbitControls;
  /** Preset the camera stands in, until it is moved by hand. */
  preset: Preset | undefined = "fit";
  followed = -1;
  private glide: { from: Pose; to: Pose; start: number } | undefined;
  private readonly seen = new Vector3(); // where the followed ball was when last drawn

  constructor(
    private readonly run: Run,
    private readonly world: World,
    element: HTMLElement,
    private readonly moved: () => void,
    /** Shares of the picture, from its left upper corner, that title and lists lie over. */
    private readonly covered: () => { right: number; bottom: number },
  ) {
    this.camera.up.set(...world.up);
    this.controls = new OrbitControls(this.camera, element);
    this.controls.enableDamping = false;
    this.controls.zoomToCursor = true;
    this.controls.maxPolarAngle = Math.PI * 0.98;
    this.controls.mouseButtons = { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.PAN, RIGHT: MOUSE.PAN };
    this.controls.touches = { ONE: TOUCH.ROTATE, TWO: TOUCH.DOLLY_PAN };
    const extent = Math.hypot(...add(world.box[1], world.box[0], -1));
    this.controls.minDistance = 1.5 * Math.min(world.size, extent);
    this.controls.maxDistance = 12 * extent;
    this.controls.addEventListener("start", () => {
      this.glide = undefined;
      this.preset = undefined;
    });
    this.controls.addEventListener("change", () => this.moved());
    this.place(this.pose("fit"));
  }

  resize(width: number, height: number): void {
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.preset && this.followed < 0) this.place(this.pose(this.preset));
  }

  go(preset: Preset, atOnce: boolean): void {
    this.followed = -1;
    this.preset = preset;
    if (atOnce) this.place(this.pose(preset));
    else this.glideTo(this.pose(preset));
  }

  /** Comes close to a ball and stays with it; -1 lets go. */
  follow(body: number): void {
    this.followed = body;
    if (body < 0) return;
    this.preset = undefined;
    this.ball(this.seen);
    const target = this.seen.clone();
    const sight = this.camera.position.clone().sub(this.controls.target);
    const near = 26 * this.run.radius[body];
    if (sight.length() > near) sight.setLength(near);
    this.glideTo({ eye: target.clone().add(sight), target });
  }

  /** By keys what the mouse does: turn and tilt around the middle of the view, and come nearer. */
  nudge(turn: number, tilt: number, zoom: number): void {
    this.glide = undefined;
    this.preset = undefined;
    const { target, minDistance, maxDistance } = this.controls;
    const up = this.camera.up.clone().normalize();
    const sight = this.camera.position.clone().sub(target).applyAxisAngle(up, turn);
    const polar = sight.angleTo(up);
    const to = Math.min(Math.max(polar - tilt, 0.02), this.controls.maxPolarAngle);
    const right = up.clone().cross(sight).normalize();
    if (right.lengthSq() > 0) sight.applyAxisAngle(right, to - polar);
    sight.setLength(Math.min(Math.max(sight.length() / zoom, minDistance), maxDistance));
    this.camera.position.copy(target).add(sight);
    this.moved();
  }

  /** Before each picture; true while the camera still moves by itself. */
  update(): boolean {
    if (this.followed >= 0) {
      const step = this.ball(new Vector3()).sub(this.seen);
      if (step.lengthSq() > 0) {
        this.seen.add(step);
        this.camera.position.add(step);
        this.controls.target.add(step);
        for (const pose of this.glide ? [this.glide.from, this.glide.to] : []) {
          pose.eye.add(step);
          pose.target.add(step);
        }
      }
    }
    if (this.glide) {
      const { from, to, start } = this.glide;
      const s = Math.min(1, (performance.now() - start) / GLIDE_MS);
      const ease = s * s * (3 - 2 * s);
      this.place({ eye: from.eye.clone().lerp(to.eye, ease), target: from.target.clone().lerp(to.target, ease) });
      if (s >= 1) this.glide = undefined;
    }
    this.controls.update();
    this.depthRange();
    return this.glide !== undefined;
  }

  private ball(into: Vector3): Vector3 {
    return into.fromArray(this.run.centre, 4 * this.followed);
  }

  private glideTo(to: Pose): void {
    const from = { eye: this.camera.position.clone(), target: this.controls.target.clone() };
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) this.place(to);
    else this.glide = { from, to, start: performance.now() };
    this.moved();
  }

  private place({ eye, target }: Pose): void {
    this.camera.position.copy(eye);
    this.controls.target.copy(target);
    this.controls.update();
    this.depthRange();
  }

  /** Near and far plane close around the scene: impostors and rims share one depth buffer. */
  private depthRange(): void {
    const [low, high] = this.world.box;
    const middle = scale(add(low, high), 0.5);
    const reach = 0.75 * Math.hypot(...add(high, low, -1)) + 30 * this.world.size;
    const away = Math.hypot(...add(this.camera.position.toArray() as Vec, middle, -1));
    this.camera.near = Math.max(away - reach, 0.004 * Math.max(away, reach), 0.2 * this.world.size);
    this.camera.far = away + 2.5 * reach;
    this.camera.updateProjectionMatrix();
  }

  /** Stands so that the whole box is in view, seen along the preset's direction, and clear of what lies over the picture. */
  private pose(preset: Preset): Pose {
    const { right, bottom } = this.covered();
    const most = Math.min(bottom, MOST_FREE);
    for (let free = 0; ; free = Math.min(free + 0.02, most)) {
      const { pose, seen } = this.below(preset, free);
      const pairs = seen.flatMap((p, i) => seen.slice(i + 1).map((q) => [p, q]));
      if (free >= most || !pairs.some(([p, q]) => reaches(p, q, right, bottom))) return pose;
    }
  }

  /** The same in what lies below a share `free` of the picture; and where it shows the corners of the box, in shares of it. */
  private below(preset: Preset, free: number): { pose: Pose; seen: [number, number][] } {
    const { up, box } = this.world;
    // What is long lies across the screen, or along it where the screen is upright.
    const across = this.camera.aspect < 0.8 ? cross(up, this.world.across) : this.world.across;
    const back = cross(up, across); // away from the viewer
    const sight = {
      fit: add(add(scale(back, -1), across, -0.1), up, 0.85),
      top: add(up, back, -0.001),
      side: add(scale(back, -1), up, 0.2),
      end: add(scale(across, -1), up, 0.3),
    }[preset];
    const toward = unit(sight); // from the scene to the eye
    const right = unit(cross(up, toward));
    const above = cross(toward, right);
    const tanY = Math.tan((this.camera.fov * Math.PI) / 360);
    const tanX = tanY * this.camera.aspect;
    const rim = (this.run.table ? 0.5 : this.world.table ? 6 : 1.5) * this.world.size;
    const margin = up.map((u) => rim * (1 - Math.abs(u))) as Vec; // level, whichever axis is up
    const low = add(box[0], margin, -1);
    const high = add(box[1], margin);
    const points = corners(low, high);
    let target = scale(add(low, high), 0.5);
    // From the middle of the picture up and down to where the box may reach, in halves of its height.
    const [top, bottom] = [1 - free - MARGIN * free, 1 - free + MARGIN * free];
    let distance = 0;
    let seen: [number, number][] = [];
    // The nearer side looks larger: shift the target until the margins on both sides are equal.
    for (let k = 0; k < 8; k++) {
      const spans = points.map((p) => {
        const d = add(p, target, -1);
        return [dot(d, right), dot(d, above), dot(d, toward)];
      });
      distance = Math.max(
        ...spans.map(([x, y, z]) => z + MARGIN * Math.max(Math.abs(x) / tanX, y / tanY / top, -y / tanY / bottom)),
      );
      const slope = (i: number) => spans.map((s) => s[i] / (distance - s[2]));
      const middle = (i: number) => 0.5 * (Math.max(...slope(i)) + Math.min(...slope(i)));
      const [aside, rise] = [middle(0) * distance, (middle(1) + free * tanY) * distance];
      target = add(add(target, right, aside), above, rise);
      seen = spans.map(([x, y, z]) => {
        const [across, up] = [(x - aside) / tanX, (y - rise) / tanY].map((s) => s / (distance - z));
        return [0.5 + 0.5 * across, 0.5 - 0.5 * up];
      });
    }
    return { pose: { eye: new Vector3(...add(target, toward, distance)), target: new Vector3(...target) }, seen };
  }
}

/** Whether the line from p to q has a point to the left of `right` and above `bottom`. */
function reaches(p: [number, number], q: [number, number], right: number, bottom: number): boolean {
  let [from, to] = [0, 1];
  for (const [a, b] of [[p[0] - right, q[0] - right], [p[1] - bottom, q[1] - bottom]]) {
    if (a >= 0 && b >= 0) return false;
    if (a >= 0) from = Math.max(from, a / (a - b));
    else if (b >= 0) to = Math.min(to, a / (a - b));
  }
  return from < to;
}
