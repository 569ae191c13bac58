// Included by the tests of the interior point and by those of `hold`.

/// Contacts without discs, with each disc, with all, and a joint, all coupled; W unsymmetric.
fn mixed(rng: &mut Rng) -> Problem {
    let mut groups: Vec<RowGroup> = Vec::new();
    for (sliding, rolling, spinning) in [
        (0.0, 0.0, 0.0),
        (0.6, 0.0, 0.0),
        (0.0, 0.3, 0.0),
        (0.0, 0.0, 0.2),
        (0.9, 0.2, 0.1),
    ] {
        let bounds = Bounds {
            sliding,
            rolling,
            spinning,
        };
        let row = groups.last().map_or(0, |g| g.row + g.dim);
        groups.push(RowGroup {
            row,
            dim: bounds.dim(),
            bounds,
            bilateral: false,
            least: 0.0,
        });
    }
    let row = groups.last().map_or(0, |g| g.row + g.dim);
    groups.push(RowGroup {
        row,
        dim: 2,
        bounds: Bounds::default(),
        bilateral: true,
        least: 0.0,
    });
    let c = groups.len();
    let ptr = (0..=c).map(|i| i * c).collect();
    let col = (0..c * c).map(|k| (k % c) as u32).collect();
    let mut w = BlockMatrix::zeros(&groups, ptr, col);
    w.values
        .iter_mut()
        .for_each(|v| *v = rng.uniform(-0.2, 0.2));
    for i in 0..c {
        let dim = groups[i].dim;
        let k = w.diagonal[i];
        for r in 0..dim {
            w.block_mut(i, k)[r * dim + r] += 2.0;
        }
    }
    let n = row + 2;
    Problem {
        groups,
        w,
        q: (0..n).map(|_| rng.uniform(-1.0, 1.0)).collect(),
    }
}
