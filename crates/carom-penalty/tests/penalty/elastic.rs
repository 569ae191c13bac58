//! Hertz's law with the numbers of billiard balls.

use carom_core::Options;
use carom_penalty::elastic::Elastic;

#[test]
fn billiard_balls_have_the_stiffness_of_their_resin() {
    let e = Elastic::new(&Options::default());
    let k = e.stiffness(2.0 / 0.028575);
    assert!((k - 4.96e8).abs() < 1e6, "{k:e}");
    let inv_mass = 2.0 / 0.17;
    let d = e.deepest(k, 0.5 / inv_mass);
    assert!((d - (5.0 / (4.0 * k * inv_mass)).powf(0.4)).abs() < 1e-15);
    assert!((e.force(k, d) * d / 2.5 - 0.5 / inv_mass).abs() < 1e-12);
    assert!((e.indentation(k, e.force(k, d)) - d).abs() < 1e-15);
}
