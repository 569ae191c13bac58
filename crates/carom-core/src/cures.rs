//! What may help a step that did not converge: only settings that are not there yet.

use crate::options::{Options, Solver, MOST_HALVINGS_TRIED};

/// Values of `pile_tolerance` (1) with which islands of thousands of contacts are solved, the usual one first. Others would be advised in vain.
const PILE_TOLERANCES: [f64; 2] = [1e-4, 1e-3];
/// Largest `tolerance` (1) that is proposed: a result whose residual is larger is none. Larger: users are sent to results that are no results.
const MOST_TOLERANCE: f64 = 1e-4;

/// In words, for a problem of so many contacts that was left with this residual.
pub fn cures(o: &Options, contacts: u32, residual: f64) -> String {
    let usual = Options::default();
    let mut found = Vec::new();
    if o.solver != Solver::Auto {
        found.push("solver = \"auto\"".to_owned());
    }
    if o.max_iterations < usual.max_iterations {
        found.push(format!("max_iterations = {}", usual.max_iterations));
    }
    if o.gauss_seidel_sweeps < usual.gauss_seidel_sweeps {
        found.push(format!(
            "gauss_seidel_sweeps = {}",
            usual.gauss_seidel_sweeps
        ));
    }
    if contacts > o.dense_contacts {
        let mut coarser = PILE_TOLERANCES.iter().filter(|&&t| o.pile_tolerance < t);
        if let Some(tolerance) = coarser.next() {
            found.push(format!("pile_tolerance = {tolerance:e}"));
        }
    } else if residual < 0.1 * MOST_TOLERANCE {
        found.push(format!(
            "tolerance = 1e{}",
            residual.log10().floor() as i32 + 1
        ));
    }
    if o.deepest() < MOST_HALVINGS_TRIED {
        found.push(format!("max_halvings = {MOST_HALVINGS_TRIED}"));
    }
    match found.as_slice() {
        [] => "no other setting is known to solve it; on_nonconvergence = \"warn\" goes on with what was reached, and \
               counts such steps as unconverged"
            .to_owned(),
        [one] => format!("try {one}"),
        [most @ .., last] => format!("try {} or {last}", most.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_is_not_advised() {
        let o = Options::default();
        assert_eq!(cures(&o, 60, 1e-3), "try pile_tolerance = 1e-4");
        assert_eq!(cures(&o, 3, 2e-6), "try tolerance = 1e-5");
        let usual = Options {
            pile_tolerance: 1e-4,
            ..o.clone()
        };
        assert_eq!(cures(&usual, 60, 1e-3), "try pile_tolerance = 1e-3");
        let loose = Options {
            pile_tolerance: 1e-3,
            ..usual
        };
        assert!(cures(&loose, 60, 1e-3).starts_with("no other setting"));
        let poor = Options {
            max_iterations: 3,
            gauss_seidel_sweeps: 0,
            max_halvings: 1,
            ..loose
        };
        let told = "try max_iterations = 50, gauss_seidel_sweeps = 15 or max_halvings = 8";
        assert_eq!(cures(&poor, 60, 1e-3), told);
    }
}
