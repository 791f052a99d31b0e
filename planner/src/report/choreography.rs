//! Residuals of a motion's targets and height limits, computed from the values of a plan in the frame of its first sample.

use super::grid::{State, Timeline, Window};
use super::residual::{Grid, WorstCase};
use crate::families::Family;
use crate::motion::{Ends, Subject};
use nalgebra::{Rotation3, Vector3};

/// Deviations from targets, and violations of height limits.
pub fn residuals(timeline: &Timeline, grid: Grid) -> Vec<WorstCase> {
    let mut found = targets(timeline, grid);
    found.push(heights(timeline, grid));
    found
}

/// Height of a subject above the ground, m.
fn height_m(state: &State, of: Subject) -> f64 {
    state.ground.body().height_above_m(&position(state, of))
}

/// Position of a subject in the world, m.
fn position(state: &State, of: Subject) -> Vector3<f64> {
    match of {
        Subject::Com => state.com(),
        Subject::Body => state.sample.base_position_m.into(),
        Subject::EndEffector(j) => state.contact(j),
    }
}

/// Value and slope of the parabola through three values one unit apart, at `u` from the middle one.
fn parabola<V>([before, here, after]: [V; 3], u: f64) -> (V, V)
where
    V: Copy
        + std::ops::Add<Output = V>
        + std::ops::Sub<Output = V>
        + std::ops::Mul<f64, Output = V>,
{
    let (slope, bend) = ((after - before) * 0.5, (after - here) - (here - before));
    (here + slope * u + bend * (0.5 * u * u), slope + bend * u)
}

fn targets(timeline: &Timeline, grid: Grid) -> Vec<WorstCase> {
    let mut places = WorstCase::of(Family::TargetPosition, grid);
    let mut velocities = WorstCase::of(Family::TargetVelocity, grid);
    let mut headings = WorstCase::of(Family::TargetHeading, grid);
    let plan = timeline.plan;
    let windows: Vec<Window> = timeline.samples().collect();
    let start = windows[0].here.sample;
    let start_yaw = start.base_yaw_pitch_roll_rad[0];
    let to_start = Rotation3::from_axis_angle(&Vector3::z_axis(), -start_yaw);
    let origin = Vector3::new(start.base_position_m[0], start.base_position_m[1], 0.0);
    // Motions that are not periodic have no neighbours beyond their ends.
    let inner = match plan.motion.ends {
        Ends::Periodic => 0..=windows.len() - 1,
        Ends::AtRest | Ends::Prescribed => 1..=windows.len() - 2,
    };
    let h = timeline.spacing_s();
    for target in &plan.motion.targets {
        let nearest = (target.at_s / h).round() as usize;
        let w = &windows[nearest.clamp(*inner.start(), *inner.end())];
        let u = target.at_s / h - w.index as f64;
        let around = [w.before, w.here, w.after];
        let seen = around.map(|s| to_start * (position(s, target.of) - origin));
        let (mut place, per_interval) = parabola(seen, u);
        (place.z, _) = parabola(around.map(|s| height_m(s, target.of)), u);
        let velocity = per_interval / h;
        let name = target.of.name(&plan.robot);
        for (c, direction) in ["forward", "left", "up"].into_iter().enumerate() {
            let subject = format!("{name} {direction} at {:.3} s", target.at_s);
            if let Some(wanted) = target.position_m[c] {
                let off = (place[c] - wanted).abs();
                places.record(off, w, Some(&subject));
            }
            if let Some(wanted) = target.velocity_m_s[c] {
                let off = (velocity[c] - wanted).abs();
                velocities.record(off, w, Some(&subject));
            }
        }
        if let Some(wanted) = target.heading_rad {
            let yaws = around.map(|s| s.sample.base_yaw_pitch_roll_rad[0] - start_yaw);
            let off = (parabola(yaws, u).0 - wanted).abs();
            headings.record(off, w, Some(&format!("{name} at {:.3} s", target.at_s)));
        }
    }
    vec![places, velocities, headings]
}

/// Violation of height limits within their time spans, m. On the samples of a plan, the two samples around a span count too.
fn heights(timeline: &Timeline, grid: Grid) -> WorstCase {
    let mut worst = WorstCase::of(Family::HeightLimit, grid);
    let plan = timeline.plan;
    for limit in &plan.motion.heights {
        for w in timeline.samples() {
            let within = match grid {
                Grid::Samples => limit.holds_at(&plan.motion, w.index),
                _ => (limit.from_s..=limit.to_s).contains(&w.here.sample.time_s),
            };
            if within {
                let z = height_m(w.here, limit.of);
                let over = limit.below_m.map_or(0.0, |below_m| z - below_m);
                let under = limit.above_m.map_or(0.0, |above_m| above_m - z);
                let beyond = over.max(under).max(0.0);
                worst.record(beyond, &w, Some(limit.of.name(&plan.robot)));
            }
        }
    }
    worst
}
