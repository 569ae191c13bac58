"""Dense flows in a sheared periodic box: ratio of stresses over the inertial number, beside published fits.

    python validation/shear/mu_i.py [--grains 800] [--strain 4] [--csv FILE] [--figure FILE]

Rigid grains of 0.8 to 1.2 mm, friction 0.5, restitution 0.5, no gravity, are sheared at a constant rate in a box that
keeps its volume (Lees-Edwards boundaries), at several packing fractions. The first quarter of the strain is left out.
Stresses are those of `carom.granular.stress` over the whole box: mu = -s_zx/s_zz, I = rate d sqrt(density/s_zz). Rigid
grains have no time of their own: mu and I depend on the packing fraction alone, and not on the rate.

Beside it: mu = 0.38 + (0.64 - 0.38)/(1 + 0.279/I) (P. Jop, Y. Forterre, O. Pouliquen, Nature 441, 2006), measured with
glass beads; and the same form fitted to what is found here up to I = 0.25.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
import warnings
from pathlib import Path

import carom
import numpy as np
from carom import granular
from scipy.optimize import curve_fit

DIAMETER, DENSITY, RATE = 1e-3, 2500.0, 1.0
FRACTIONS = (0.50, 0.53, 0.55, 0.565, 0.575, 0.583, 0.589, 0.594)
STRAIN_PER_STEP, STRAIN_PER_FRAME = 5e-4, 0.01
#: mu_s, mu_2, I_0 of glass beads.
PUBLISHED = (0.38, 0.64, 0.279)
#: Largest inertial number of the fit: above it flows are dilute, and the form does not follow them.
DENSE = 0.25


def law(inertial, low, high, scale):
    """mu(I)."""
    return low + (high - low) / (1.0 + scale / inertial)


def flow(fraction: float, grains: int, strain: float, seed: int, impact: str) -> carom.Scene:
    """Grains at random in a box that shears."""
    # Mean cube of a diameter that is uniform within a fifth of its mean.
    volume = grains * np.pi / 6 * DIAMETER**3 * 1.04
    side = float((volume / fraction) ** (1 / 3))
    made = carom.Scene(
        "shear",
        gravity=(0, 0, 0),
        periodic=(side, side, side),
        run={
            "until": strain / RATE,
            "step": STRAIN_PER_STEP / RATE,
            "impact": impact,
            "pile_tolerance": 1e-6,
        },
        record={"every": round(STRAIN_PER_FRAME / STRAIN_PER_STEP)},
    )
    made.deform(shear={"polynomial": [0.0, RATE]}, flow="x", gradient="z")
    made.contact("glass", "glass", friction=0.5, restitution=0.5)
    made.packing(
        "grain",
        material="glass",
        density=DENSITY,
        sizes="uniform",
        smallest=0.8 * DIAMETER,
        largest=1.2 * DIAMETER,
        count=grains,
        region="box",
        low=(0, 0, 0),
        high=(side, side, side),
        periodic="xyz",
        seed=seed,
    )
    return made


def measured(result: carom.Result) -> dict[str, float]:
    """Means over the frames behind the first quarter."""
    frames = range(len(result.time) // 4 + 1, len(result.time))
    tensors = [granular.stress(result, granular.whole_box(result, k), k).tensor for k in frames]
    mean = np.mean(tensors, axis=0)
    # In eight parts of the time: how far their means are apart.
    parts = [np.mean(part, axis=0) for part in np.array_split(tensors, 8)]
    ratios = [-part[2, 0] / part[2, 2] for part in parts]
    radius, side = granular.snapshot(result).radius, np.asarray(result.periodic)
    return {
        "fraction": float(4 / 3 * np.pi * (radius**3).sum() / side.prod()),
        "mu": float(-mean[2, 0] / mean[2, 2]),
        "error": float(np.std(ratios, ddof=1) / np.sqrt(len(ratios))),
        "inertial": float(RATE * DIAMETER * np.sqrt(DENSITY / mean[2, 2])),
        "normal_xx": float(mean[0, 0] / mean[2, 2]),
        "normal_yy": float(mean[1, 1] / mean[2, 2]),
        "contacts": float(np.asarray(result.steps["contacts"]).mean()),
        "fallbacks": float(np.asarray(result.steps["fallbacks"]).sum()),
        "unconverged": float(np.asarray(result.steps["unconverged"]).sum()),
    }


def fitted(rows: list[dict[str, float]]) -> tuple[np.ndarray, np.ndarray] | None:
    """mu_s, mu_2 and I_0 of the same form for dense flows, and their standard errors."""
    dense = [row for row in rows if row["inertial"] <= DENSE]
    if len(dense) < 4:
        return None
    inertial = np.array([row["inertial"] for row in dense])
    mu = np.array([row["mu"] for row in dense])
    found, spread = curve_fit(law, inertial, mu, p0=PUBLISHED, maxfev=10_000)
    return np.asarray(found), np.sqrt(np.diag(spread))


def draw(rows: list[dict[str, float]], fit: tuple[np.ndarray, np.ndarray] | None, path: str) -> None:
    """The picture of the page."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot as plt
    from matplotlib.ticker import NullFormatter

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    inertial = [row["inertial"] for row in rows]
    line = np.geomspace(0.6 * min(inertial), 1.2 * max(inertial), 100)
    left.errorbar(
        inertial, [row["mu"] for row in rows], [row["error"] for row in rows], fmt="o", label="Carom"
    )
    left.plot(line, law(line, *PUBLISHED), "k--", label="glass beads (Jop et al. 2006)")
    if fit is not None:
        left.plot(line, law(line, *fit[0]), "C0", lw=1, label=f"fit, I up to {DENSE:g}")
    left.set(xscale="log", xlabel="inertial number I", ylabel="stress ratio mu")
    left.legend(frameon=False)
    right.plot(inertial, [row["fraction"] for row in rows], "o-")
    right.set(xscale="log", xlabel="inertial number I", ylabel="packing fraction")
    right.xaxis.set_minor_formatter(NullFormatter())
    figure.savefig(path)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grains", type=int, default=800)
    parser.add_argument("--strain", type=float, default=4.0)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--fractions", type=float, nargs="+", default=list(FRACTIONS))
    parser.add_argument(
        "--impact", default="one-shot", help="the impact law; sequence takes ten times as long"
    )
    parser.add_argument("--csv")
    parser.add_argument("--figure")
    options = parser.parse_args()
    print(f"{options.grains} grains, strain {options.strain:g}, {STRAIN_PER_STEP:g} a step")
    print(
        "fraction      I       mu  +-      glass   s_xx/s_zz s_yy/s_zz contacts fallbacks unconverged seconds"
    )
    rows = []
    for fraction in options.fractions:
        begin = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", carom.CaromWarning)
            result = carom.simulate(
                flow(fraction, options.grains, options.strain, options.seed, options.impact)
            )
        row = measured(result) | {"seconds": time.perf_counter() - begin}
        rows.append(row)
        print(
            f"{row['fraction']:.4f}  {row['inertial']:8.4f}  {row['mu']:.3f}  {row['error']:.3f}  "
            f"{law(row['inertial'], *PUBLISHED):.3f}  {row['normal_xx']:9.3f} {row['normal_yy']:9.3f} "
            f"{row['contacts']:8.0f} {row['fallbacks']:9.0f} {row['unconverged']:11.0f} {row['seconds']:7.0f}",
            flush=True,
        )
    fit = fitted(rows)
    if fit is not None:
        names, glass = ("mu_s", "mu_2", "I_0"), PUBLISHED
        terms = zip(names, *fit, glass, strict=True)
        text = ", ".join(f"{name} {found:.3f} +- {error:.3f} ({of:g})" for name, found, error, of in terms)
        print(f"fit up to I = {DENSE:g} (glass beads): {text}")
    if options.csv:
        with Path(options.csv).open("w", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows(rows)
    if options.figure:
        draw(rows, fit, options.figure)
    return 0


if __name__ == "__main__":
    sys.exit(main())
