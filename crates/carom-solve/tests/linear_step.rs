//! The step of large islands with loads is that of the dense matrix.

use carom_solve::cone::{self, Bounds, MAX_ROWS};
use carom_solve::linear_step::{Iterate, LinearStep};
use carom_solve::rows::{RowSystem, WORLD};

/// Two spheres in contact with friction, the second on a joint and both on a load: the matrix of large islands gives
/// the increments of the dense one, with curvature and an unsymmetric tangent.
#[test]
fn large_islands_with_loads_take_the_same_step() {
    let mut system = RowSystem::default();
    let nodes: Vec<u32> = (0..2)
        .map(|k| system.push_node(1.0 + f64::from(k), 0.3, 0.5))
        .collect();
    let bounds = Bounds {
        sliding: 0.4,
        rolling: 0.0,
        spinning: 0.0,
    };
    let rows: Vec<[[f64; 6]; 2]> = [
        [
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        ],
        [
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.5],
            [0.0, -1.0, 0.0, 0.0, 0.0, 0.5],
        ],
        [
            [0.0, 0.0, 1.0, 0.0, -0.5, 0.0],
            [0.0, 0.0, -1.0, 0.0, -0.5, 0.0],
        ],
    ]
    .to_vec();
    let (z, normal) = ([-0.2, 0.3, -0.1], [1.0, 0.0, 0.0]);
    system.push_contact(nodes[0], nodes[1], bounds, 0.5, normal, &rows, &z);
    system.contacts[0].curvature = 0.7;
    let joint = [[[0.0, 0.6, 0.8, 0.1, 0.0, 0.0], [0.0; 6]]];
    system.push_joint((nodes[1], WORLD), 1, 0.5, &joint, &[0.05]);
    system.open_load();
    for (k, b) in system.load.iter_mut().enumerate() {
        *b = 0.01 * k as f64;
    }
    for row in 0..12u32 {
        for col in 0..12u32 {
            let value = 0.02 * f64::from((7 * row + 3 * col) % 5);
            system.load_tangent.push((row, col, value));
            system.load_tangent.push((row, col, 0.5 * value));
        }
    }
    let (lambda, u) = ([0.1, 0.02, 0.0, -0.03], [0.01; 12]);
    let penalty: Vec<f64> = system.diag.iter().map(|d| 0.5 / d).collect();
    let measures = [z[0], z[1], z[2], 0.05];
    let xi: Vec<f64> = (0..4)
        .map(|r| lambda[r] - penalty[r] * measures[r])
        .collect();
    let (mut phi, mut tangents) = ([0.0; 4], [[[0.0; MAX_ROWS]; MAX_ROWS]; 2]);
    let statuses = [
        cone::project(&bounds, &xi[..3], &mut phi[..3]),
        cone::pass(&xi[3..], &mut phi[3..]),
    ];
    cone::tangent(&bounds, &xi[..3], &mut tangents[0]);
    cone::pass_tangent(1, &mut tangents[1]);
    let step = |dense: bool| {
        let at = Iterate {
            penalty: &penalty,
            phi: &phi,
            tangents: &tangents,
            statuses: &statuses,
            lambda: &lambda,
            u: &u,
            softness: 0.0,
        };
        let (mut dl, mut du) = ([0.0; 4], [0.0; 12]);
        LinearStep::default()
            .solve(&system, &at, 1e-3, false, dense, &mut dl, &mut du)
            .expect("a step");
        [dl.to_vec(), du.to_vec()].concat()
    };
    let (small, large) = (step(true), step(false));
    assert!(small.iter().any(|x| x.abs() > 1e-2));
    for (s, l) in small.iter().zip(&large) {
        assert!((s - l).abs() < 1e-12, "{small:?} {large:?}");
    }
}
