//! Slip of the motion as played, during stance: mean speed, and distance within one stance.
//!
//! Splines violate the ground constraints between samples, so that stance feet slip slightly there. Servos absorb peaks of a
//! few milliseconds; mean slip moves the robot off its path. Slip that accumulates within a stance is lost distance, however
//! slow it is: steered wheels cut corners. Slip to and fro counts twice, because friction does not restore it.

use super::grid::{Timeline, Window, feet};
use super::residual::{Grid, WorstCase};
use crate::families::Family;
use crate::problem::state::{ContactFrame, rolling_direction};
use nalgebra::Vector3;
use rollwalk_robot::EndEffector;

/// Slip velocity over an interval as seen from above, m/s: velocity of the contact point minus that of the rolling wheel or
/// foot. A wheel rolls in its direction at the middle of the interval.
pub(super) fn slip_m_s(
    timeline: &Timeline,
    w: &Window,
    j: usize,
    foot: &EndEffector,
) -> Vector3<f64> {
    let h = timeline.spacing_s();
    let moved = (w.after.contact(j) - w.here.contact(j)) / h;
    let [here, after] = [w.here, w.after].map(|s| &s.sample.end_effectors[j]);
    let ends = [w.here, w.after].map(|s| &s.frames[j]);
    let rolled = if foot.contact.rolls() {
        let angles =
            [here.tilt_rad + after.tilt_rad, here.yaw_rad + after.yaw_rad].map(|sum| 0.5 * sum);
        let frame = ContactFrame::between(foot.radius_m, angles, ends);
        let rolled = frame.rolling * (here.wheel_speed_rad_s * foot.radius_m);
        // On uneven ground, the rim moves further than the contact point.
        let turn = Vector3::z() * (after.yaw_rad - here.yaw_rad)
            + rolling_direction(angles[1]) * (after.tilt_rad - here.tilt_rad);
        let rim = ends[0].to_contact - ends[1].to_contact + turn.cross(&frame.to_contact);
        if frame.by_normal.is_some() { rolled - rim / h } else { rolled }
    } else {
        // The sphere of a foot rolls with its link.
        let normal = (ends[0].normal + ends[1].normal) * 0.5;
        w.here.link_velocity(j, w.after, h).cross(&normal) * foot.radius_m
    };
    Vector3::new(moved.x - rolled.x, moved.y - rolled.y, 0.0)
}

/// Mean slip of all stance feet, and the largest slip distance of a foot within one stance.
pub(super) fn slipping(timeline: &Timeline, grid: Grid) -> [WorstCase; 2] {
    let mut mean = WorstCase::of(Family::MeanSlip, grid);
    let mut creep = WorstCase::of(Family::Creep, grid);
    let h = timeline.spacing_s();
    let (mut way_m, mut stood_s) = (0.0, 0.0);
    for (j, foot) in feet(timeline) {
        // Slip distance of the foot in the present stance, and the last interval of the stance.
        let mut stance: Option<(f64, Window)> = None;
        let mut end = |stance: Option<(f64, Window)>| {
            if let Some((slipped_m, last)) = stance {
                creep.record(slipped_m, &last, Some(&foot.name));
            }
        };
        for w in timeline.intervals() {
            if !(w.here.stands(j) && w.after.stands(j)) {
                end(stance.take());
                continue;
            }
            let slipped_m = slip_m_s(timeline, &w, j, foot).norm() * h;
            way_m += slipped_m;
            stood_s += h;
            let before_m = stance.take().map_or(0.0, |(before_m, _)| before_m);
            stance = Some((before_m + slipped_m, w));
        }
        end(stance);
    }
    if stood_s > 0.0 {
        mean.record_whole(way_m / stood_s);
    }
    [mean, creep]
}
