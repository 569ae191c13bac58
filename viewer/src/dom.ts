// The page's elements, by id; a missing one is a fault of the template and says so.

export function byId<T extends HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no #${id}`);
  return element as T;
}

export function create<K extends keyof HTMLElementTagNameMap>(tag: K, name = "", text = ""): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (name) element.className = name;
  if (text) element.textContent = text;
  return element;
}

const LONGEST = 32; // characters of a name in a label; text.py has the same for figures

/** A name of at most so many characters: what is too much goes from the middle, as names often differ at their ends. */
export function shortened(name: string, most = LONGEST): string {
  const letters = Array.from(name);
  if (letters.length <= most) return name;
  const end = Math.floor((most - 1) / 3);
  return `${letters.slice(0, most - 1 - end).join("").trimEnd()}\u2026${letters.slice(-end).join("").trimStart()}`;
}

const MOST_DIGITS = 5; // after the point of a mantissa

/** Whether numbers up to `large` are written out; others have an exponent, unless their digits go on behind the point. */
const plain = (large: number, step = 1): boolean => large === 0 || (large >= 1e-3 && (large < 1e5 || step < 1));

/** A number that changes by `step`, among numbers up to `large`, with a real minus sign and a fixed width while it changes. */
export function figure(value: number, step: number, large = 1): string {
  if (plain(large, step)) {
    const digits = decimals(step);
    const text = value.toFixed(digits);
    return Number(text) === 0 ? (0).toFixed(digits) : text.replace("-", "\u2212");
  }
  if (!(Math.abs(value) >= 0.5 * step)) return "0";
  const digits = Math.floor(Math.log10(Math.abs(value))) - Math.floor(Math.log10(step) + 1e-9);
  return exponential(value.toExponential(Math.min(Math.max(digits, 0), MOST_DIGITS)));
}

/** A number by itself, with three significant digits; in columns (`padded`) with the zeros at its end. */
export function amount(value: number, padded = false): string {
  if (plain(Math.abs(value))) {
    const text = value.toPrecision(3);
    return (padded && !text.includes("e") ? text : String(+text)).replace("-", "\u2212");
  }
  const [mantissa, exponent] = value.toExponential(2).split("e");
  return exponential(`${padded ? mantissa : +mantissa}e${exponent}`);
}

const exponential = (text: string): string => text.replace("+", "").replace(/-/g, "\u2212");

/** Decimals needed to show `step` as a change. */
export function decimals(step: number): number {
  return step > 0 ? Math.min(Math.max(Math.ceil(-Math.log10(step) - 1e-9), 0), 9) : 3;
}
