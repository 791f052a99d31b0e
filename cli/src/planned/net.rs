//! Net displacement of a library's motions, from SAFE and back to SAFE.

use rollwalk_planner::motion::Ends;
use rollwalk_simulate::PlannedDisplacement;
use rollwalk_terminal::planning::Plans;

/// Messages about goals of motions at rest that are undone on the path from SAFE and back to SAFE. Such a motion shifts the
/// body over fixed contacts, and its transitions shift the body back.
pub fn undone_goals(plans: &Plans) -> Vec<String> {
    const NAMES: [&str; 3] = ["forward_m", "left_m", "turn_rad"];
    let joined = |from: usize, to: usize| {
        let found = plans.transitions.iter().find(|of| (of.from, of.to) == (from, to));
        found.map(|of| of.planned.plan.reached())
    };
    let mut found = Vec::new();
    for (number, motion) in plans.motions.iter().enumerate() {
        let plan = &motion.plan;
        let PlannedDisplacement { way, goals } = PlannedDisplacement::new(plan);
        if plan.motion.ends != Ends::AtRest || !goals.contains(&true) {
            continue;
        }
        let (Some(there), Some(back)) = (joined(plans.safe, number), joined(number, plans.safe))
        else {
            continue;
        };
        let net = [there, way.values(), back].into_iter().fold([0.0; 3], compose);
        for of in (0..3).filter(|&of| goals[of]) {
            let (wanted, left) = (way.values()[of], net[of]);
            if left / wanted < 0.95 {
                found.push(format!(
                    "{}: {} is {wanted:.3} in the plan, but only {left:.3} remain when the robot is back in SAFE: feet and wheels stay in place, so the transitions move the body back over them. Let feet step or wheels roll",
                    plan.motion.name, NAMES[of]
                ));
            }
        }
    }
    found
}

/// Adds a second displacement, given in the final heading of the first.
fn compose([x_m, y_m, turned_rad]: [f64; 3], [forward_m, left_m, turn_rad]: [f64; 3]) -> [f64; 3] {
    let (sine, cosine) = turned_rad.sin_cos();
    [
        x_m + forward_m * cosine - left_m * sine,
        y_m + forward_m * sine + left_m * cosine,
        turned_rad + turn_rad,
    ]
}
