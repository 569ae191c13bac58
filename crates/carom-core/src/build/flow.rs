//! Checks of inflows and outlets.

use super::ModelInput;
use crate::flow::{Flow, Region};
use crate::outcome::{within_bounds, Entry, ModelError, FASTEST};
use crate::wall;
use glam::DVec3;

/// Balls that a joint or a load of their own holds; what is no ball may be among them. Drag holds none.
fn held_bodies(input: &ModelInput) -> impl Iterator<Item = u32> + '_ {
    let joined = input.joints.iter().flat_map(|j| [j.a, j.b]);
    let loads = input.loads.iter().filter(|load| load.holds());
    joined.chain(loads.flat_map(|l| l.bodies()).flatten())
}

/// Checks those of a description.
pub(super) fn compile(input: &ModelInput) -> Result<Flow, ModelError> {
    let (n, clumps) = (input.radius.len(), input.clumps.len());
    let bodies = match input.inflow.is_empty() {
        true => 0,
        false => n + clumps,
    };
    let mut taken = vec![false; bodies];
    for (index, flow) in input.inflow.iter().enumerate() {
        let inflow = Entry("inflow", index);
        let refuse = |quantity, text: String| Err(inflow.refused((quantity, text)));
        let of = flow.bodies();
        if of.end > n + clumps || (of.start < n && of.end > n) {
            let text =
                format!("are {of:?}; there are {n} spheres, and {clumps} clumps behind them");
            return refuse("bodies", text);
        }
        if taken[of.clone()].iter().any(|&t| t) {
            return refuse("bodies", "are those of another inflow too".to_owned());
        }
        let mut of_clumps = input.clumps.iter().map(|c| &c.balls);
        if of_clumps.any(|balls| balls.start < of.end && of.start < balls.end) {
            return refuse("bodies", "are balls of a clump too".to_owned());
        }
        if flow.turned && of.start < n {
            return refuse("turned", "is for clumps; balls are round".to_owned());
        }
        taken[of].fill(true);
        let fits = match flow.region {
            Region::Box { low, high } => low.cmple(high).all(),
            Region::Disc { normal, radius, .. } => normal.is_normalized() && radius >= 0.0,
        };
        if !fits {
            let text = format!(
                "is {:?}; it must be a box (low, high) or a disc (centre, unit normal, radius)",
                flow.region
            );
            return refuse("region", text);
        }
        // Bodies enter where bodies may be from the start.
        for corner in flow.region.bounds() {
            wall::place("region", corner).map_err(|why| inflow.refused(why))?;
        }
        inflow.finite("velocity", &flow.velocity.to_array())?;
        for (quantity, value) in [
            ("rate", flow.rate),
            ("start", flow.start),
            ("spread", flow.spread),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                let text = format!("is {value}; it must be finite and not negative");
                return refuse(quantity, text);
            }
        }
        let fastest = flow.velocity.abs() + DVec3::splat(flow.spread);
        if !within_bounds(fastest, DVec3::ZERO) {
            let text = format!(
                "is {:?} m/s with a spread of {} m/s; a ball may enter with at most {FASTEST:e} m/s",
                flow.velocity, flow.spread
            );
            return refuse("velocity", text);
        }
    }
    if let Some(body) = held_bodies(input).find(|&b| taken.get(b as usize) == Some(&true)) {
        let text =
            format!("has a joint or a load of its own (sphere {body}): what enters must be free");
        return Err(Entry("inflow", 0).refused(("bodies", text)));
    }
    for (index, outlet) in input.outlet.iter().enumerate() {
        let fits = outlet.low.cmplt(outlet.high).all();
        if !fits || outlet.low.is_nan() || outlet.high.is_nan() {
            let text = "needs a lowest and a highest corner".to_owned();
            return Err(Entry("outlet", index).refused(("box", text)));
        }
    }
    Ok(Flow {
        inflows: input.inflow.clone(),
        outlets: input.outlet.clone(),
        held: held(input),
    })
}

/// Of each ball and clump whether outlets leave it: what joints or loads hold, a clump by any ball of it, and balls of clumps, which leave with these.
fn held(input: &ModelInput) -> Vec<bool> {
    if input.outlet.is_empty() {
        return Vec::new();
    }
    let n = input.radius.len();
    let mut held = vec![false; n + input.clumps.len()];
    for body in held_bodies(input) {
        if let Some(held) = held.get_mut(body as usize) {
            *held = true;
        }
    }
    for (clump, i) in input.clumps.iter().zip(n..) {
        held[i] = held[clump.balls.clone()].contains(&true);
        held[clump.balls.clone()].fill(true);
    }
    held
}
