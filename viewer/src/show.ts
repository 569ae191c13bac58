// The menu of what is drawn, and the key that says what the arrows mean.

import { amount, byId, create } from "./dom";
import type { Overlay, Shown } from "./overlay";
import type { Run } from "./run";

type Switch = "velocities" | "contacts" | "impacts" | "links" | "through";
const SWITCHES: Switch[] = ["velocities", "contacts", "impacts", "links", "through"];
const TRAILS: Shown["trails"][] = ["off", "recent", "whole"];

export class Show {
  private readonly menu = byId("show");
  private readonly key = byId("key");
  private readonly trails = byId<HTMLSelectElement>("trails");
  private readonly size = byId<HTMLInputElement>("size");
  private said = "";

  constructor(
    private readonly run: Run,
    private readonly overlay: Overlay,
    private readonly changed: () => void,
  ) {
    const { shown } = overlay;
    for (const name of SWITCHES) {
      const box = byId<HTMLInputElement>(name);
      box.disabled = !this.has(name);
      if (box.disabled) box.closest("label")!.title = "not in this page";
      box.addEventListener("change", () => this.set(name, box.checked));
    }
    byId("links").closest("label")!.hidden = !overlay.links.present;
    this.trails.addEventListener("change", () => {
      shown.trails = this.trails.value as Shown["trails"];
      this.trails.blur();
      this.changed();
    });
    this.size.addEventListener("input", () => {
      shown.scale = 2 ** Number(this.size.value);
      this.changed();
    });
    this.sync();
  }

  get open(): boolean {
    return !this.menu.hidden;
  }

  show(on: boolean): void {
    this.menu.hidden = !on;
  }

  toggle(name: Switch): void {
    if (this.has(name)) this.set(name, !this.overlay.shown[name]);
  }

  nextTrails(): void {
    const { shown } = this.overlay;
    shown.trails = TRAILS[(TRAILS.indexOf(shown.trails) + 1) % TRAILS.length];
    this.changed();
  }

  set<K extends keyof Shown>(name: K, value: Shown[K]): void {
    this.overlay.shown[name] = value;
    this.changed();
  }

  /** Controls and key as things stand. */
  update(): void {
    this.sync();
    const { shown, largest } = this.overlay;
    const lines: string[][] = [];
    const longest = (value: number | undefined, unit: string) => (value === undefined ? "none now" : `longest ${amount(value)} ${unit}`);
    const bars = this.run.count > 64;
    if (shown.velocities) lines.push(["velocity", `velocity, ${longest(largest.velocity, "m/s")}`]);
    if (shown.contacts && this.has("contacts")) {
      const mean = `mean since the frame before, ${longest(largest.contact, "N").replace("longest", bars ? "greatest" : "longest")}`;
      lines.push(["stick", "stick"], ["slip", "slip"], ["", `contact force: ${mean}`]);
    }
    if (shown.impacts && this.has("impacts") && largest.impact !== undefined) {
      if (!shown.contacts) lines.push(["stick", "stick"], ["slip", "slip"]);
      lines.push(["", `impulse, ${longest(largest.impact, "N s")}; numbers: order of the impacts`]);
    }
    if (this.overlay.cut) lines.push(["", "the largest are drawn shorter than they are"]);
    const text = JSON.stringify(lines);
    if (text === this.said) return;
    this.said = text;
    this.key.hidden = lines.length === 0;
    this.key.replaceChildren(
      ...lines.map(([dot, words]) => {
        const entry = create("span");
        if (dot) entry.append(create("i", `dot ${dot}`));
        entry.append(words);
        return entry;
      }),
    );
  }

  private has(name: Switch): boolean {
    if (name === "contacts") return this.run.contacts !== undefined;
    if (name === "impacts") return this.run.impacts !== undefined;
    return name !== "links" || this.overlay.links.present;
  }

  private sync(): void {
    const { shown } = this.overlay;
    for (const name of SWITCHES) byId<HTMLInputElement>(name).checked = shown[name] && this.has(name);
    this.trails.value = shown.trails;
    this.size.value = String(Math.log2(shown.scale));
  }
}
