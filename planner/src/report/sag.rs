//! Swing height that servos without torque feed-forward lose. Joints deflect by torque over stiffness, so that the body sinks
//! between the stance legs, and a swing leg hangs lower.

use super::grid::{State, Timeline, feet};
use rollwalk_multibody::euler::JOINTS;
use serde::Serialize;
use std::fmt;

/// Fraction of a swing's height that may be lost without a warning.
const MAY_BE_LOST: f64 = 0.5;

/// Swing that loses the largest fraction of its height.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sag {
    /// Name of the end effector in swing.
    pub end_effector: String,
    /// Time of the highest point, s.
    pub time_s: f64,
    /// Planned height at that time, m.
    pub height_m: f64,
    /// Height that servos without torque feed-forward lose, m.
    pub lost_m: f64,
}

impl Sag {
    /// Returns true if the swing loses enough height that it may touch the ground.
    pub fn is_much(&self) -> bool {
        self.lost_m > MAY_BE_LOST * self.height_m
    }
}

impl fmt::Display for Sag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { end_effector, time_s, height_m, lost_m } = self;
        let [lost_mm, height_mm] = [lost_m, height_m].map(|length| 1e3 * length);
        // A loss greater than the whole height means that the ground is in the way.
        let lost = if lost_m < height_m { format!("{lost_mm:.0}") } else { "all".to_owned() };
        write!(
            f,
            "without torque feed-forward, servos yield: {end_effector} loses {lost} of the \
             {height_mm:.0} mm height of its swing at {time_s:.3} s"
        )
    }
}

/// Returns the swing that loses the largest fraction of its height; `None` if nothing swings.
pub fn sag(timeline: &Timeline) -> Option<Sag> {
    let mut worst: Option<Sag> = None;
    for w in timeline.samples() {
        let sinks_m = {
            let standing = feet(timeline).filter(|(j, _)| w.here.stands(*j));
            let yields: Vec<f64> = standing.map(|(j, _)| yields_m(timeline, w.here, j)).collect();
            if yields.is_empty() {
                continue;
            }
            yields.iter().sum::<f64>() / yields.len() as f64
        };
        for (j, foot) in feet(timeline).filter(|(j, _)| !w.here.stands(*j)) {
            let height = |state: &State| state.contact_height_m(j);
            let height_m = height(w.here);
            if height_m <= 0.0 || height_m < height(w.before).max(height(w.after)) {
                continue;
            }
            let found = Sag {
                end_effector: foot.name.clone(),
                time_s: w.here.sample.time_s,
                height_m,
                lost_m: (sinks_m - yields_m(timeline, w.here, j)).max(0.0),
            };
            let part = |sag: &Sag| sag.lost_m / sag.height_m;
            if worst.as_ref().is_none_or(|worst| part(&found) > part(worst)) {
                worst = Some(found);
            }
        }
    }
    worst
}

/// Rise of an end effector relative to the body, m, if each motor of its limb deflects by its torque over its stiffness. Motors
/// without stiffness are taken as rigid.
fn yields_m(timeline: &Timeline, state: &State, j: usize) -> f64 {
    let limb = timeline.model.chain(j).dofs.iter().zip(&state.pose.end_effectors[j].d_center);
    limb.filter(|(dof, _)| **dof >= JOINTS)
        .map(|(dof, column)| {
            let ratios = state.pose.frames.ratios(timeline.model.tree());
            let motors = ratios.motor_ratios(dof - JOINTS).iter();
            let yields_rad = motors.map(|of| {
                let stiffness_nm_rad = timeline.plan.robot.joints[of.joint].stiffness_nm_rad();
                let yields_rad = state.sample.joint_torque_nm[of.joint] / stiffness_nm_rad;
                if stiffness_nm_rad > 0.0 { of.ratio * yields_rad } else { 0.0 }
            });
            -yields_rad.sum::<f64>() * column.z
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_plans;

    /// Sag of the box of [`test_plans`] with its front left wheel lifted at one sample and all legs at one angle.
    fn lifted(torque_nm: f64) -> Option<Sag> {
        let mut plan = test_plans::cruise();
        let sample = &mut plan.samples[6];
        sample.end_effectors[0].contact = false;
        sample.end_effectors[0].position_m[2] = 0.03;
        sample.joint_rad.fill(0.5);
        sample.joint_torque_nm.fill(torque_nm);
        sample.joint_torque_nm[0] = 0.0;
        plan.robot.joints.iter_mut().for_each(|joint| joint.actuator.kp_nm_rad = 20.0);
        sag(&Timeline::new(&plan))
    }

    #[test]
    fn the_body_sinks_by_what_legs_yield() {
        // A leg of 0.2 m at 0.5 rad yields by 1 N·m / 20 N·m/rad.
        let sinks_m = 0.2 * 0.5_f64.sin() * 0.05;
        let [one, other] = [1.0, -1.0].map(|torque_nm| lifted(torque_nm).expect("a swing").lost_m);
        assert!((one.max(other) - sinks_m).abs() < 1e-12 && one.min(other) == 0.0, "{one} {other}");
        assert!(!lifted(1.0).expect("a swing").is_much());
        let much = [4.0, -4.0].into_iter().filter_map(lifted).any(|sag| sag.is_much());
        assert!(much, "19 of 30 mm");
        let all = [40.0, -40.0].into_iter().filter_map(lifted).find(|sag| sag.is_much());
        let words = all.expect("a swing").to_string();
        assert!(words.contains("loses all of the 30 mm"), "{words}");
        assert_eq!(sag(&Timeline::new(&test_plans::cruise())), None, "nothing swings");
    }
}
