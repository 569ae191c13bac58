//! Numbers that cannot be simulated are refused, and the refusal says which.

mod common;

use carom_core::{ModelError, ModelInput, Options};
use common::{compile, on_floor, refusal};

#[test]
fn what_is_not_finite_is_refused_by_name() {
    type Change = fn(&mut ModelInput, f64);
    let places: [(&str, Change); 13] = [
        ("radius of sphere 0", |m, x| m.radius[0] = x),
        ("mass of sphere 0", |m, x| m.mass[0] = x),
        ("inertia of sphere 0", |m, x| m.inertia[0] = x),
        ("position of sphere 0", |m, x| m.position[0][1] = x),
        ("velocity of sphere 0", |m, x| m.velocity[0][2] = x),
        ("angular_velocity of sphere 0", |m, x| {
            m.angular_velocity[0][0] = x
        }),
        ("orientation of sphere 0", |m, x| m.orientation[0][3] = x),
        ("gravity of world 0", |m, x| m.gravity[2] = x),
        ("point of plane 0", |m, x| m.plane_point[0][0] = x),
        ("normal of plane 0", |m, x| m.plane_normal[0][0] = x),
        ("coefficients of contact law 0", |m, x| m.laws[0].2[0] = x),
        ("coefficients of contact law 0", |m, x| m.laws[0].2[1] = x),
        ("coefficients of contact law 0", |m, x| m.laws[0].2[4] = x),
    ];
    for (name, change) in places {
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let text = refusal(|m| change(m, x));
            assert!(text.starts_with(name), "{text}");
        }
    }
}

#[test]
fn what_is_out_of_bounds_is_refused() {
    type Change = fn(&mut ModelInput);
    let places: [(&str, Change); 14] = [
        ("radius of sphere 0", |m| m.radius[0] = 0.0),
        ("radius of sphere 0", |m| m.radius[0] = -1.0),
        ("mass of sphere 0", |m| m.mass[0] = -0.17),
        ("inertia of sphere 0", |m| m.inertia[0] = 0.0),
        ("orientation of sphere 0", |m| {
            m.orientation[0] = [2.0, 0.0, 0.0, 0.0]
        }),
        ("orientation of sphere 0", |m| m.orientation[0] = [0.0; 4]),
        ("normal of plane 0", |m| m.plane_normal[0] = [0.0; 3]),
        ("friction of contact law 0", |m| m.laws[0].2[0] = -0.1),
        ("restitution of contact law 0", |m| m.laws[0].2[1] = 1.1),
        ("restitution of contact law 0", |m| m.laws[0].2[1] = -0.1),
        ("tangential_restitution of contact law 0", |m| {
            m.laws[0].2[2] = 1.1
        }),
        ("tangential_restitution of contact law 0", |m| {
            m.laws[0].2[2] = -1.0
        }),
        ("rolling_radius of contact law 0", |m| {
            m.laws[0].2[3] = -1e-3
        }),
        ("spinning_radius of contact law 0", |m| {
            m.laws[0].2[4] = -1e-3
        }),
    ];
    for (name, change) in places {
        let text = refusal(change);
        assert!(text.starts_with(name), "{text}");
    }
}

#[test]
fn arrays_that_do_not_fit_together_are_refused() {
    assert!(matches!(
        compile(&ModelInput::default(), Options::default()),
        Err(ModelError::Empty)
    ));
    type Change = fn(&mut ModelInput);
    let places: [(&str, Change); 9] = [
        ("mass", |m| m.mass.clear()),
        ("inertia", |m| m.inertia.push(1.0)),
        ("material", |m| m.material.clear()),
        ("position", |m| m.position.push([0.0; 3])),
        ("orientation", |m| m.orientation.clear()),
        ("velocity", |m| m.velocity.clear()),
        ("angular_velocity", |m| m.angular_velocity.push([0.0; 3])),
        ("plane_normal", |m| m.plane_normal.clear()),
        ("plane_material", |m| m.plane_material.clear()),
    ];
    for (name, change) in places {
        let text = refusal(change);
        assert!(text.starts_with(&format!("array {name} has ")), "{text}");
    }
}

#[test]
fn options_that_cannot_work_are_refused_by_name() {
    type Change = fn(&mut Options);
    let places: [(&str, Change); 14] = [
        ("step", |o| o.step = 0.0),
        ("step", |o| o.step = -1e-3),
        ("step", |o| o.step = f64::NAN),
        ("tolerance", |o| o.tolerance = 0.0),
        ("pile_tolerance", |o| o.pile_tolerance = f64::NAN),
        ("gap_tolerance", |o| o.gap_tolerance = -1.0),
        ("proximal_shift", |o| o.proximal_shift = f64::INFINITY),
        ("spectral_radius", |o| o.spectral_radius = 1.0),
        ("spectral_radius", |o| o.spectral_radius = f64::NAN),
        ("penalty_scale", |o| o.penalty_scale = 2.0),
        ("restitution_threshold", |o| o.restitution_threshold = -1.0),
        ("max_iterations", |o| o.max_iterations = 0),
        ("max_problems", |o| o.max_problems = 100_001),
        ("max_halvings", |o| o.max_halvings = 21),
    ];
    for (name, change) in places {
        let mut options = Options::default();
        change(&mut options);
        let found = compile(&on_floor([0.2, 0.0, 0.0, 0.0, 0.0]), options);
        let Err(ModelError::Option { name: found, .. }) = found else {
            panic!("{name} was accepted");
        };
        assert_eq!(found, name);
    }
}

#[test]
fn names_that_the_core_does_not_know_are_refused() {
    use carom_core::Value;
    let mut options = Options::default();
    assert!(options.set("stepp", &Value::Float(1e-3)).is_err());
    assert!(options
        .set("impact", &Value::Text("sequenz".into()))
        .is_err());
    assert!(options.set("max_problems", &Value::Float(1.5)).is_err());
    assert!(options.set("step", &Value::Float(1e-4)).is_ok());
    assert_eq!(options.step, 1e-4);
    // Every option can be read and set back.
    for (name, value) in Options::default().entries() {
        assert!(options.set(name, &value).is_ok(), "{name}");
    }
}

#[test]
fn a_saved_state_of_another_model_or_without_numbers_is_refused() {
    use carom_core::{Simulation, State};
    use glam::{DQuat, DVec3};
    let (model, initial) =
        compile(&on_floor([0.2, 0.5, 0.0, 0.0, 0.0]), Options::default()).expect("valid");
    let simulation = Simulation::new(model, initial);
    type Damage = fn(&mut State);
    let damages: [(&str, Damage); 7] = [
        ("position is for 0 bodies", |s| s.position.clear()),
        ("joint_reaction is for 1 joints", |s| {
            s.reaction.push(Default::default())
        }),
        ("present and entered", |s| s.entered.push(1)),
        ("velocity holds a number", |s| s.velocity[0] = DVec3::NAN),
        ("orientation has norm 0", |s| {
            s.orientation[0] = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)
        }),
        ("orientation has norm NaN", |s| {
            s.orientation[0].x = f64::NAN
        }),
        ("warm_step must be", |s| s.warm_step = 0.0),
    ];
    assert_eq!(simulation.state.check(&simulation.model), Ok(()));
    for (said, damage) in damages {
        let mut state = simulation.state.clone();
        damage(&mut state);
        let error = state.check(&simulation.model).expect_err(said).to_string();
        assert!(error.starts_with(&format!("state: {said}")), "{error}");
    }
}
