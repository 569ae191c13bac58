// Included by the tests of `spheres/coarse`, those of its public items and those of its private ones.

/// Towers of 16 spheres on a floor, 12 by 12 of them, under a load of 1 m/s.
const HIGH: usize = 16;

struct Towers {
    sweeps: Sweeps,
    /// What holds the towers.
    holding: Vec<[f64; 3]>,
}

fn towers(threads: usize, friction: f64) -> Towers {
    let place = |i: usize| -> Place {
        let [x, y, z] = [i / HIGH % 12, i / HIGH / 12, i % HIGH];
        [x, y, z].map(|k| 2.5 * k as f64)
    };
    let bodies = vec![
        Body {
            inv_mass: 0.5,
            inv_inertia: 1.0,
            radius: 1.0,
        };
        144 * HIGH
    ];
    let places: Vec<Place> = (0..bodies.len()).map(place).collect();
    let contacts: Vec<Contact> = (0..bodies.len())
        .map(|i| {
            let bottom = i % HIGH == 0;
            Contact {
                a: i as u32,
                b: if bottom { WORLD } else { i as u32 - 1 },
                normal: [0.0, 0.0, 1.0],
                slip: [0.0, 0.0, if bottom { -1.0 } else { 0.0 }],
                friction,
            }
        })
        .collect();
    let holding = (0..bodies.len()).map(|i| [0.0, 0.0, 2.0 * (HIGH - i % HIGH) as f64]);
    Towers {
        sweeps: Sweeps::new(&bodies, &contacts, Some(&places), threads).unwrap(),
        holding: holding.collect(),
    }
}

const GOAL: Goal = Goal {
    tolerance: 1e-8,
    floor: 0.0,
    scale: 0.0,
    closing: 1e-8,
    worst: 1.0,
    penalty_scale: 0.5,
    patience: usize::MAX,
    most: 2_000,
    had: 0,
    rescale: usize::MAX,
    weighed: false,
    calm: 1.0,
};
