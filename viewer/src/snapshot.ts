// The picture as a file: what the canvas shows, with labels, time and title, twice as sharp as on the screen.

import type { Run } from "./run";
import type { Stage } from "./stage";

const TIMES = 2;

/** Labels, numbers and badges are elements over the canvas: they are written into the picture as they stand. */
export function snapshot(run: Run, stage: Stage, digits: number): HTMLCanvasElement {
  const picture = stage.picture(TIMES);
  const pen = picture.getContext("2d")!;
  const { left, top, width } = stage.canvas.getBoundingClientRect();
  const scale = picture.width / width;
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.textBaseline = "middle";
  for (const element of document.querySelectorAll<HTMLElement>("#labels span, #badges span, #key:not([hidden]), #stage h1")) {
    if (element.hidden || !element.textContent) continue;
    const box = element.getBoundingClientRect();
    const style = getComputedStyle(element);
    pen.fillStyle = style.backgroundColor;
    pen.beginPath();
    pen.roundRect(box.left - left, box.top - top, box.width, box.height, Math.min(parseFloat(style.borderRadius) || 0, box.height / 2));
    pen.fill();
    for (const part of element.id === "key" ? element.querySelectorAll<HTMLElement>("span") : [element]) words(pen, part, left, top);
  }
  const time = `t = ${run.now.toFixed(digits)} s`;
  const style = getComputedStyle(document.body);
  pen.font = `600 15px ${style.fontFamily}`;
  pen.textAlign = "right";
  const wide = pen.measureText(time).width + 20;
  const key = document.querySelector<HTMLElement>("#key:not([hidden])");
  const height = picture.height / scale - (key ? key.offsetHeight + 6 : 0);
  pen.fillStyle = style.getPropertyValue("--paper-clear");
  pen.beginPath();
  pen.roundRect(width - 12 - wide, height - 40, wide, 28, 8);
  pen.fill();
  pen.fillStyle = style.color;
  pen.fillText(time, width - 22, height - 26);
  return picture;
}

function words(pen: CanvasRenderingContext2D, element: HTMLElement, left: number, top: number): void {
  const style = getComputedStyle(element);
  const box = element.getBoundingClientRect();
  const dot = element.querySelector(".dot");
  if (dot) {
    const spot = dot.getBoundingClientRect();
    pen.fillStyle = getComputedStyle(dot).backgroundColor;
    pen.beginPath();
    pen.arc(spot.left - left + spot.width / 2, spot.top - top + spot.height / 2, spot.width / 2, 0, 7);
    pen.fill();
  }
  pen.fillStyle = style.color;
  pen.font = `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
  pen.textAlign = "right";
  const padding = parseFloat(style.paddingRight) || 0;
  const room = box.width - 2 * padding - (dot ? 12 : 0); // what the page breaks into lines is set narrower here
  pen.fillText(element.textContent!, box.right - left - padding, box.top - top + box.height / 2 + 0.5, room + 1);
}

/** Offers the picture as a file with the time in its name. */
export function save(picture: HTMLCanvasElement, title: string, time: string): void {
  picture.toBlob((blob) => {
    if (!blob) return;
    const link = document.createElement("a");
    const stem = title.replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "").slice(0, 60) || "carom";
    link.download = `${stem}_${time}s.png`;
    link.href = URL.createObjectURL(blob);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }, "image/png");
}
