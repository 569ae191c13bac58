// One graph over time on a 2D canvas: drawn once, then only the cursor moves over it.

import { create, figure, shortened } from "./dom";
import { linear } from "./palette";

export interface Series {
  name: string;
  /** A colour, or the name of a CSS variable (`--ink`). */
  colour: string;
  time: ArrayLike<number>;
  value: ArrayLike<number>;
  dashed?: boolean;
}

const LEFT = 58;
const RIGHT = 10;
const TOP = 8;
const BOTTOM = 20;

export class Graph {
  readonly element = create("figure");
  private readonly canvas = create("canvas");
  private readonly legend = create("figcaption");
  private readonly sheet = document.createElement("canvas");
  private series: Series[] = [];
  private values: HTMLElement[] = [];
  private chips: HTMLElement[] = [];
  private unit = "";
  private range: [number, number] = [0, 1];
  private step = 1e-3;
  private large = 1;
  private stale = true;

  constructor(
    private readonly start: number,
    private readonly end: number,
    seek: (time: number) => void,
  ) {
    this.element.append(this.legend, this.canvas);
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", "Graph over time");
    const drag = (event: PointerEvent) => {
      const { left, width } = this.canvas.getBoundingClientRect();
      const share = (event.clientX - left - LEFT) / Math.max(1, width - LEFT - RIGHT);
      seek(this.start + Math.min(Math.max(share, 0), 1) * (this.end - this.start));
    };
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      drag(event);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (this.canvas.hasPointerCapture(event.pointerId)) drag(event);
    });
  }

  /** `head` stands before the legend: a title, or a choice of what to show. Differences below `least` are noise. */
  show(head: HTMLElement, unit: string, series: Series[], least = 0): void {
    this.series = series;
    this.unit = unit;
    let [low, high] = [Infinity, -Infinity];
    for (const { value } of series) {
      for (let i = 0; i < value.length; i++) {
        if (!Number.isFinite(value[i])) continue; // of a ball that is absent
        low = Math.min(low, value[i]);
        high = Math.max(high, value[i]);
      }
    }
    if (!(low <= high)) [low, high] = [0, 1];
    if (low < high && high - low < least) [low, high] = [0.5 * (low + high) - least, 0.5 * (low + high) + least];
    const margin = 0.06 * (high - low) || 0.1 * Math.abs(high) || 1;
    this.range = [low >= 0 && low < 0.3 * high ? 0 : low - margin, high + margin];
    this.large = Math.max(...this.range.map(Math.abs));
    this.step = Math.max((this.range[1] - this.range[0]) / 500, 1e-9 * this.large);
    this.canvas.setAttribute("aria-label", `${series.map((s) => s.name).join(", ")} in ${unit} over time`);
    this.values = series.map(() => create("b"));
    this.chips = series.map((s) => create("i", s.dashed ? "dash" : ""));
    const entries = series.map((s, i) => {
      const entry = create("span");
      entry.append(this.chips[i], shortened(s.name), " ", this.values[i]);
      entry.title = s.name;
      return entry;
    });
    this.legend.replaceChildren(head, ...entries);
    this.stale = true;
  }

  /** After a change of size or of the theme. */
  refresh(): void {
    this.stale = true;
  }

  cursor(time: number): void {
    const { canvas, sheet } = this;
    const ratio = devicePixelRatio;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (width === 0) return;
    if (this.stale || sheet.width !== Math.round(width * ratio) || sheet.height !== Math.round(height * ratio)) {
      sheet.width = canvas.width = Math.round(width * ratio);
      sheet.height = canvas.height = Math.round(height * ratio);
      this.draw(width, height, ratio);
      this.stale = false;
    }
    const pen = canvas.getContext("2d")!;
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(sheet, 0, 0);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const x = this.x(time, width);
    pen.fillStyle = this.css("--accent");
    pen.fillRect(x - 0.75, TOP, 1.5, height - TOP - BOTTOM);
    this.series.forEach((s, i) => {
      const value = at(s, time);
      this.values[i].textContent = value === undefined ? "" : `${figure(value, this.step, this.large)} ${this.unit}`;
      if (value === undefined) return;
      pen.fillStyle = this.colour(s);
      pen.beginPath();
      pen.arc(x, this.y(value, height), 3, 0, 7);
      pen.fill();
    });
  }

  private draw(width: number, height: number, ratio: number): void {
    const pen = this.sheet.getContext("2d")!;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = "11px system-ui, sans-serif";
    pen.lineWidth = 1;
    const [faint, edge] = [this.css("--faint"), this.css("--edge")];
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const v of ticks(this.range[0], this.range[1], height / 38)) {
      const y = this.y(v.at, height);
      pen.fillStyle = edge;
      pen.fillRect(LEFT, Math.round(y), width - LEFT - RIGHT, 1);
      pen.fillStyle = faint;
      pen.fillText(v.text, LEFT - 6, y);
    }
    pen.textAlign = "center";
    pen.textBaseline = "alphabetic";
    for (const t of ticks(this.start, this.end, width / 90)) {
      const x = this.x(t.at, width);
      pen.fillStyle = edge;
      pen.fillRect(Math.round(x), TOP, 1, height - TOP - BOTTOM);
      pen.fillStyle = faint;
      const text = `${t.text} s`;
      pen.fillText(text, Math.min(x, width - 0.5 * pen.measureText(text).width - 1), height - 6);
    }
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, TOP - 2, width - LEFT - RIGHT, height - TOP - BOTTOM + 4);
    pen.clip();
    pen.lineWidth = 1.6;
    pen.lineJoin = "round";
    for (const [i, s] of this.series.entries()) {
      pen.strokeStyle = this.chips[i].style.borderColor = this.colour(s);
      pen.setLineDash(s.dashed ? [5, 3] : []);
      pen.beginPath();
      let drawing = false;
      for (let i = 0; i < s.value.length; i++) {
        const v = s.value[i];
        if (!Number.isFinite(v)) drawing = false;
        else if (drawing) pen.lineTo(this.x(s.time[i], width), this.y(v, height));
        else {
          pen.moveTo(this.x(s.time[i], width), this.y(v, height));
          drawing = true;
        }
      }
      pen.stroke();
    }
    pen.restore();
  }

  private x(time: number, width: number): number {
    const span = this.end - this.start || 1;
    return LEFT + ((time - this.start) / span) * (width - LEFT - RIGHT);
  }
  private y(value: number, height: number): number {
    const [low, high] = this.range;
    return height - BOTTOM - ((value - low) / (high - low)) * (height - TOP - BOTTOM);
  }
  private css(name: string): string {
    return getComputedStyle(this.element).getPropertyValue(name);
  }
  private colour(s: Series): string {
    return s.colour.startsWith("--") ? this.css(s.colour) : legible(s.colour);
  }
}

/** A ball's colour, lighter in the dark and darker in the light where it would be lost: black balls, white ones. */
function legible(css: string): string {
  const [r, g, b] = linear(css);
  const bright = 0.2126 * r + 0.7152 * g + 0.0722 * b;
  const dark = document.documentElement.dataset.theme === "dark";
  if (dark && bright < 0.09) return `color-mix(in srgb, ${css}, white 45%)`;
  if (!dark && bright > 0.7) return `color-mix(in srgb, ${css}, black 40%)`;
  return css;
}

/** The value at a time, straight between its neighbours; undefined where there is none. */
function at({ time, value }: Series, t: number): number | undefined {
  let low = 0;
  let high = time.length - 1;
  if (high < 0) return undefined;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (time[middle] <= t) low = middle;
    else high = middle - 1;
  }
  const next = Math.min(low + 1, time.length - 1);
  const span = time[next] - time[low];
  const s = span > 0 ? Math.min(Math.max((t - time[low]) / span, 0), 1) : 0;
  const found = s > 0 ? value[low] + s * (value[next] - value[low]) : value[low];
  return Number.isFinite(found) ? found : undefined;
}

/** Round numbers between two others, `wanted` of them or fewer. */
function ticks(low: number, high: number, wanted: number): { at: number; text: string }[] {
  const rough = (high - low) / Math.max(1, wanted);
  if (!(rough > 0)) return [];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5, 10].find((m) => m * power >= rough) ?? 10);
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  const large = Math.max(Math.abs(low), Math.abs(high));
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => {
    const value = (first + i) * step;
    return { at: value, text: figure(value, step, large) };
  });
}
