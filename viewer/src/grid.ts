/** 1, 2 or 5 times a power of ten, so that squares tell lengths: several balls wide, tens across the floor. */
export function gridSpacing(size: number, reach: number): number {
  const wanted = Math.max(4 * size, reach / 25);
  const power = 10 ** Math.floor(Math.log10(wanted));
  return power * ([1, 2, 5].find((k) => k * power >= wanted) ?? 10);
}
