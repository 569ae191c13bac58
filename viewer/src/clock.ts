// Time: playing, speed, loop, and steps from frame to frame.

import type { Run } from "./run";

export const SPEEDS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10];

export class Clock {
  time: number;
  playing = false;
  loop = false;
  speed: number;

  constructor(
    private readonly run: Run,
    private readonly changed: () => void,
  ) {
    this.time = run.start;
    // Real time, unless all would be over in a blink or take an hour.
    const span = run.end - run.start || 1;
    this.speed = span < 1.5 ? closest(span / 6) : span > 60 ? closest(span / 40) : 1;
  }

  play(on = !this.playing): void {
    this.playing = on && this.run.frames > 1;
    if (this.playing && this.time >= this.run.end) this.time = this.run.start;
    this.changed();
  }

  seek(time: number): void {
    this.time = Math.min(Math.max(time, this.run.start), this.run.end);
    this.changed();
  }

  /** To the next recorded frame, or the one `count` further on or back. */
  step(count: number): void {
    this.playing = false;
    const here = this.run.frameAt(this.time + 1e-12 * (this.run.end - this.run.start));
    // Between two frames a step back goes to the one just passed.
    const between = this.time > this.run.time[here] && count < 0 ? 1 : 0;
    const frame = Math.min(Math.max(here + count + between, 0), this.run.frames - 1);
    this.seek(this.run.time[frame]);
  }

  faster(by: 1 | -1): void {
    const at = SPEEDS.indexOf(this.speed);
    this.speed = SPEEDS[Math.min(Math.max(at + by, 0), SPEEDS.length - 1)];
    this.changed();
  }

  /** A picture later: `wall` seconds have passed. */
  advance(wall: number): void {
    if (!this.playing) return;
    this.time += wall * this.speed;
    if (this.time < this.run.end) return;
    const span = this.run.end - this.run.start;
    if (this.loop && span > 0) {
      this.time = this.run.start + ((this.time - this.run.start) % span);
    } else {
      this.time = this.run.end;
      this.playing = false;
      this.changed();
    }
  }
}

function closest(speed: number): number {
  const off = (s: number) => Math.abs(Math.log(s / speed));
  return SPEEDS.reduce((a, b) => (off(b) < off(a) ? b : a));
}
