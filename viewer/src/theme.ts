// Dark and light: as the system says until the reader says otherwise.

export interface Shades {
  day: number;
  back: [string, string]; // middle and rim of the background
  ground: string;
  rim: string;
  line: string;
  accent: string;
  shadow: number;
  pane: number;
}

const LIGHT: Shades = {
  day: 1,
  back: ["#f4f5f7", "#ccd2da"],
  ground: "#c9ced6",
  rim: "#8f99a8",
  line: "#5d6877",
  accent: "#ff8a00",
  shadow: 0.9,
  pane: 0.05,
};

const DARK: Shades = {
  day: 0,
  back: ["#232830", "#0c0e12"],
  ground: "#3a414c",
  rim: "#5b6675",
  line: "#9aa7b8",
  accent: "#ffb04a",
  shadow: 0.95,
  pane: 0.05,
};

export class Theme {
  private chosen: "light" | "dark" | undefined;
  private readonly system = matchMedia("(prefers-color-scheme: dark)");

  constructor(private readonly changed: (shades: Shades) => void) {
    this.system.addEventListener("change", () => this.apply());
  }

  get name(): "light" | "dark" {
    return this.chosen ?? (this.system.matches ? "dark" : "light");
  }

  toggle(): void {
    this.chosen = this.name === "dark" ? "light" : "dark";
    this.apply();
  }

  apply(): void {
    document.documentElement.dataset.theme = this.name;
    this.changed(this.name === "dark" ? DARK : LIGHT);
  }
}
