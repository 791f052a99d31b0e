//! Robots and random points for tests.

use crate::model::Model;
use crate::motion::{Ends, Goal, Motion};
use crate::plan::Placement;
use crate::problem::Unknowns;
use crate::variables::Layout;
use nalgebra::DVector;
use rollwalk_robot::Robot;

/// The shipped robots: driven wheels, free wheels, feet.
pub fn all() -> Vec<Robot> {
    [
        ("agilebot.toml", include_str!("../../robots/agilebot.toml")),
        ("swizzlebot.toml", include_str!("../../robots/swizzlebot.toml")),
        ("creature3.toml", include_str!("../../robots/creature3.toml")),
    ]
    .map(|(name, text)| Robot::from_toml(name, text).expect("shipped robots are valid"))
    .to_vec()
}

/// Uniform numbers in −1..1 from a linear congruential generator (Knuth's MMIX constants).
pub fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A random configuration near the nominal one.
pub fn random_q(model: &Model, seed: u64) -> DVector<f64> {
    let mut random = uniform(seed);
    model.nominal_q().map(|q| q + 0.4 * random())
}

/// Random slots and placement: consecutive slots differ by turns well below half a revolution.
pub fn random_unknowns(model: &Model, slots: usize, seed: u64) -> Unknowns {
    let layout = Layout::new(model);
    let mut random = uniform(seed);
    let slots = (0..slots)
        .map(|_| {
            let mut vars = layout.scale.map(|scale| 0.4 * scale * random());
            for dof in 0..layout.dofs {
                vars[dof] += model.nominal_q()[dof];
            }
            vars
        })
        .collect();
    let placement = Placement { offset_m: [0.3, -0.2], yaw_rad: 0.5 };
    Unknowns { slots, placement }
}

/// A short motion with swings, at least one in every gap.
pub fn motion(robot: &Robot, ends: Ends) -> Motion {
    let count = robot.end_effectors.len();
    let stance = (0..5).map(|i| (0..count).map(|j| (i + j) % 4 != 1).collect()).collect();
    Motion {
        name: "test".into(),
        duration_s: 0.5,
        ends,
        stance,
        swing_height_m: 0.03,
        goal: Goal { forward_m: Some(0.1), left_m: Some(0.02), turn_rad: Some(0.2) },
        posture_rad: robot.joints.iter().map(|joint| joint.nominal_rad).collect(),
    }
}
