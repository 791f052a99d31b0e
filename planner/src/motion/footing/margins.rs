//! Distances of contacts from edges, and widths of the filters that make maps of a terrain.

use rollwalk_multibody::euler::{BASE_POSITION, Model};
use rollwalk_robot::Robot;
use serde::{Deserialize, Serialize};

/// Distances between contacts and the edges of a terrain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactMargins {
    /// Distance of footholds from edges that drop, m.
    pub margin_m: f64,
    /// Distance from a wall at which a swing is above it, m. Must be at least the distance that a foot covers in one sample.
    pub swing_reach_m: f64,
}

/// Ratio of the default margin to the standing height.
const MARGIN: f64 = 0.13;
/// Ratio of the default reach of a swing to the standing height.
const SWING_REACH: f64 = 0.17;
/// Ratio of the standard deviation that smooths a swing's envelope to the reach of the swing.
const SWING_DEVIATION: f64 = 0.25;
/// Ratio of the radius of the rolling disc to that of the wheel. A disc of the wheel's own radius would stop where it touches
/// floor and wall, and the contact point would be undetermined there.
pub(super) const DISC: f64 = 1.2;
/// Ratio of the standard deviation that smooths the ground under wheels to their radius.
pub(super) const WHEEL_DEVIATION: f64 = 0.15;
/// Ratio of the standard deviation of the mean ground below the body to the distance between end effectors.
const BODY_DEVIATION: f64 = 2.0 / 3.0;
impl ContactMargins {
    /// Default margins for a robot.
    pub fn of(robot: &Robot) -> Self {
        let height_m = standing_height_m(robot);
        Self { margin_m: MARGIN * height_m, swing_reach_m: SWING_REACH * height_m }
    }
}

/// Height of the body in the nominal posture, m.
pub(in crate::motion) fn standing_height_m(robot: &Robot) -> f64 {
    Model::new(robot).standing_q(&nominal_rad(robot))[BASE_POSITION + 2].abs()
}

fn nominal_rad(robot: &Robot) -> Vec<f64> {
    robot.joints.iter().map(|joint| joint.nominal_rad).collect()
}

/// Standard deviation of the filter that smooths a swing's envelope, m.
pub(super) fn swing_deviation_m(margins: &ContactMargins) -> f64 {
    SWING_DEVIATION * margins.swing_reach_m
}

/// Standard deviation of the filter that gives the mean ground below the body, m.
pub(super) fn body_deviation_m(robot: &Robot, margins: &ContactMargins) -> f64 {
    let model = Model::new(robot);
    let pose = model.pose_values(&model.standing_q(&nominal_rad(robot)));
    let along = |axis: usize| {
        let places = pose.end_effectors.iter().map(|mount| mount.center[axis]);
        let (least, most) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), at| {
            (least.min(at), most.max(at))
        });
        most - least
    };
    BODY_DEVIATION * along(0).max(along(1)).max(margins.swing_reach_m)
}
