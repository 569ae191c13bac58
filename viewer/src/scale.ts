// How large the numbers of a run are: arrows are drawn, and digits written, in proportion to it.

import type { Run, Vec } from "./run";

/** Greatest size of a vector of a sample of bodies and frames. */
export function greatest(run: Run, of: (n: number, frame: number) => Vec): number {
  const bodies = Math.max(1, Math.floor(run.count / 500));
  const frames = Math.max(1, Math.floor(run.frames / 200));
  let most = 0;
  for (let f = 0; f < run.frames; f += frames) {
    for (let n = 0; n < run.count; n += bodies) {
      if (run.present(n, f)) most = Math.max(most, Math.hypot(...of(n, f)));
    }
  }
  return most;
}
