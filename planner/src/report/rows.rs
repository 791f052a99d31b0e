//! Residuals, each as an equation over neighbouring states.

use super::grid::{State, Timeline, Window, feet};
use super::residual::{Grid, ResidualLocation, Row, WorstCase};
use super::slipping::{slip_m_s, slipping};
use super::{choreography, clearance, motors};
use crate::families::{CLEARANCE_M, Family, ROLLING_SIGN_WIDTH_M_S};
use crate::problem::state::ContactFrame;
use nalgebra::Vector3;
use rollwalk_robot::{EndEffector, GRAVITY_M_S2};

/// Residuals of a plan at its samples.
pub fn at_samples(timeline: &Timeline) -> Vec<Row> {
    let mut found = dynamics(timeline, Grid::Samples);
    found.extend([friction(timeline), rolling_force(timeline), swing_force(timeline)]);
    found.extend(contact_motion(timeline, Grid::Samples));
    found.extend([
        end_effector_clearance(timeline),
        com(timeline),
        contact_point(timeline),
        blade_contact(timeline),
        wheel_axis(timeline),
    ]);
    if timeline.plan.motion.ground.has_edges() {
        found.push(foothold(timeline));
    }
    found.extend([motor_speed(timeline), held_wheel(timeline)]);
    found.extend(limits(timeline, Grid::Samples));
    found.extend(clearance::residuals(timeline, Grid::Samples));
    found.extend(motors::torques(timeline));
    found.extend(choreography::residuals(timeline, Grid::Samples));
    let mut rows: Vec<Row> = found.into_iter().filter_map(WorstCase::row).collect();
    rows.extend(goals(timeline));
    rows
}

/// Residuals of the motion as played. Residuals of quantities that follow from the pose are omitted, because they are 0 by
/// construction.
pub fn between(timeline: &Timeline, grid: Grid) -> Vec<Row> {
    let mut found = dynamics(timeline, grid);
    found.extend(contact_motion(timeline, grid));
    found.extend(slipping(timeline, grid));
    found.extend(choreography::residuals(timeline, grid));
    found.extend(limits(timeline, grid));
    found.extend(clearance::residuals(timeline, grid));
    let mut rows: Vec<Row> =
        found.into_iter().filter_map(|worst| worst.row_as_played(timeline)).collect();
    if grid == Grid::Library60Hz {
        // Means over frames are meaningless if samples are as close as frames.
        let of_forces =
            |row: &&mut Row| matches!(row.family, Family::LinearDynamics | Family::AngularDynamics);
        rows.iter_mut().filter(of_forces).for_each(|row| row.level = None);
    }
    rows
}

/// Residuals of the Newton–Euler equations in the centroidal frame.
fn dynamics(timeline: &Timeline, grid: Grid) -> Vec<WorstCase> {
    let mut linear = WorstCase::of(Family::LinearDynamics, grid);
    let mut angular = WorstCase::of(Family::AngularDynamics, grid);
    let mass = timeline.model.total_mass_kg();
    for w in timeline.samples() {
        // Means around the sample, with the weight 1 − |t|/h. Forces and moments are linear between samples: their
        // means over the interval to a neighbour have weights 2/3 and 1/3. At an end there is one interval.
        let inside = timeline.neighbours(&w);
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        for neighbour in &inside {
            for (state, weight) in [(w.here, 2.0 / 3.0), (*neighbour, 1.0 / 3.0)] {
                for (j, _) in feet(timeline) {
                    let f = state.force(j) * (weight / inside.len() as f64);
                    force += f;
                    moment += (state.contact(j) - state.com()).cross(&f);
                }
            }
        }
        let per_h2 = timeline.mean_of_second_derivative(&w);
        let acceleration = (w.before.com() - w.here.com() * 2.0 + w.after.com()) * per_h2;
        let gravity = Vector3::new(0.0, 0.0, -GRAVITY_M_S2);
        linear.record((force + (gravity - acceleration) * mass).norm(), &w, None);

        // Mean angular momentum of all links on the intervals before and after, times their length.
        let change =
            swept_moment(timeline, w.here, w.after) - swept_moment(timeline, w.before, w.here);
        let momentum_rate = change * per_h2;
        angular.record((moment - momentum_rate).norm(), &w, None);
    }
    vec![linear, angular]
}

/// Sum Σ m r × r₊ of all links about the centre of mass, kg·m². Each link is a mass at its centre of mass, and three pairs of
/// masses with the rest of its inertia.
fn swept_moment(timeline: &Timeline, from: &State, to: &State) -> Vector3<f64> {
    let mut moment = Vector3::zeros();
    for (l, link) in timeline.plan.robot.links.iter().enumerate() {
        let turned = |state: &State, v: &Vector3<f64>| state.pose.frames.world_from_link[l] * v;
        let place = |state: &State| {
            state.pose.frames.link_origins[l] + turned(state, &link.com_in_link_m) - state.pose.com
        };
        moment += place(from).cross(&place(to)) * link.mass_kg;
        for (axis, second) in &timeline.principal[l] {
            moment += turned(from, axis).cross(&turned(to, axis)) * *second;
        }
    }
    moment
}

fn friction(timeline: &Timeline) -> WorstCase {
    let mut worst = WorstCase::of(Family::Friction, Grid::Samples);
    for w in timeline.samples() {
        for (j, foot) in feet(timeline).filter(|(j, _)| w.here.stands(*j)) {
            let (f, normal) = (w.here.force(j), w.here.frames[j].normal);
            let load = f.dot(&normal);
            let side = f - normal * load;
            let beyond =
                side.x.hypot(side.y).hypot(side.z) - foot.friction_coefficient * load.max(0.0);
            worst.record(beyond.max(-load).max(0.0), &w, Some(&foot.name));
        }
    }
    worst
}

/// Residual of the force of free wheels along their rolling direction, against their rolling resistance.
fn rolling_force(timeline: &Timeline) -> WorstCase {
    let mut worst = WorstCase::of(Family::FreeWheelTraction, Grid::Samples);
    for w in timeline.samples() {
        for (j, foot) in feet(timeline).filter(|(j, _)| w.here.stands(*j)) {
            let Some(drag) = foot.contact.drag() else { continue };
            let f = w.here.force(j);
            let rolling_m_s = w.here.sample.end_effectors[j].wheel_speed_rad_s * foot.radius_m;
            let resistance = drag.rolling_resistance
                * (rolling_m_s / ROLLING_SIGN_WIDTH_M_S).tanh()
                + drag.rolling_drag_s_m * rolling_m_s;
            let frame = &w.here.frames[j];
            let residual = f.dot(&frame.rolling) + resistance * f.dot(&frame.normal);
            worst.record(residual.abs(), &w, Some(&foot.name));
        }
    }
    worst
}

fn swing_force(timeline: &Timeline) -> WorstCase {
    let mut worst = WorstCase::of(Family::SwingForce, Grid::Samples);
    for w in timeline.samples() {
        for (j, foot) in feet(timeline).filter(|(j, _)| !w.here.stands(*j)) {
            worst.record(w.here.force(j).norm(), &w, Some(&foot.name));
        }
    }
    worst
}

/// Residuals of slip on the ground and of height above it.
fn contact_motion(timeline: &Timeline, grid: Grid) -> Vec<WorstCase> {
    let mut slip = WorstCase::of(Family::Slip, grid);
    let mut landing = WorstCase::of(Family::LandingSlip, grid);
    let mut height = WorstCase::of(Family::ContactHeight, grid);
    let mut dip = WorstCase::of(Family::SwingDepth, grid);
    for w in timeline.intervals() {
        for (j, foot) in feet(timeline) {
            let row = match (w.here.stands(j), w.after.stands(j), foot.contact.drag()) {
                (true, true, _) => &mut slip,
                // A gliding end effector leaves the ground and lands along its direction.
                (true, false, Some(_)) | (false, true, Some(_)) => &mut landing,
                _ => continue,
            };
            row.record(slip_m_s(timeline, &w, j, foot).norm(), &w, Some(&foot.name));
        }
    }
    for w in timeline.samples() {
        for (j, foot) in feet(timeline) {
            let (row, off) = match w.here.stands(j) {
                true => (&mut height, w.here.contact_height_m(j).abs()),
                false => (&mut dip, w.here.depth_m(j)),
            };
            row.record(off, &w, Some(&foot.name));
        }
    }
    vec![slip, landing, height, dip]
}

/// Distance of footholds beyond the borders of their patches, m.
fn foothold(timeline: &Timeline) -> WorstCase {
    let mut worst = WorstCase::of(Family::Foothold, Grid::Samples);
    let ground = &timeline.plan.motion.ground;
    for w in timeline.samples() {
        for (j, foot) in feet(timeline).filter(|(j, _)| w.here.stands(*j)) {
            let place = w.here.contact(j).xy();
            let patch = ground.patch(j, &place);
            let over = patch.map_or(0.0, |patch| (patch.nearest(&place) - place).norm());
            worst.record(over, &w, Some(&foot.name));
        }
    }
    worst
}

fn end_effector_clearance(timeline: &Timeline) -> WorstCase {
    let mut worst = WorstCase::of(Family::EndEffectorClearance, Grid::Samples);
    for w in timeline.samples() {
        for (j, a) in feet(timeline) {
            let others = feet(timeline).skip(j + 1);
            let apart = |b: &EndEffector| a.link != b.link && !b.contact.is_body_point();
            for (k, b) in others.filter(|(_, b)| apart(b)) {
                let apart = (w.here.contact(j) - w.here.contact(k)).norm();
                let least = a.clearance_radius_m() + b.clearance_radius_m() + CLEARANCE_M;
                let missing = (least - apart).max(0.0);
                worst.record(missing, &w, Some(&a.name));
            }
        }
    }
    worst
}

fn com(timeline: &Timeline) -> WorstCase {
    let mut worst = WorstCase::of(Family::CentreOfMass, Grid::Samples);
    for w in timeline.samples() {
        worst.record((w.here.pose.com - w.here.com()).norm(), &w, None);
    }
    worst
}

fn contact_point(timeline: &Timeline) -> WorstCase {
    let mut worst = WorstCase::of(Family::ContactPoint, Grid::Samples);
    for w in timeline.samples() {
        for (j, foot) in feet(timeline) {
            let reached = w.here.pose.end_effectors[j].center + w.here.frames[j].to_contact;
            let off = (reached - w.here.contact(j)).norm();
            worst.record(off, &w, Some(&foot.name));
        }
    }
    worst
}

/// Distance of a skate's contact point beyond the end of its blade, along the rolling direction, m.
fn blade_contact(timeline: &Timeline) -> WorstCase {
    let mut worst = WorstCase::of(Family::BladeContact, Grid::Samples);
    for w in timeline.samples() {
        for (j, foot) in feet(timeline).filter(|(j, _)| w.here.stands(*j)) {
            let Some(blade) = foot.blade() else { continue };
            let middle = w.here.pose.end_effectors[j].world_from_link * blade.middle_in_link;
            let along = (middle * foot.radius_m).dot(&w.here.frames[j].rolling).abs();
            let beyond = (along - blade.reach_m).max(0.0);
            worst.record(beyond, &w, Some(&foot.name));
        }
    }
    worst
}

fn wheel_axis(timeline: &Timeline) -> WorstCase {
    let mut worst = WorstCase::of(Family::WheelAxis, Grid::Samples);
    for w in timeline.samples() {
        for (j, foot) in feet(timeline).filter(|(_, e)| e.contact.rolls()) {
            let off = (w.here.pose.end_effectors[j].axis - w.here.frames[j].axis).norm();
            worst.record(off, &w, Some(&foot.name));
        }
    }
    worst
}

/// Difference of the commanded motor speed from the one that the slip equation requires, ω + α̇_yaw (v·a) − Ω·a. The residual
/// is a rim speed.
fn motor_speed(timeline: &Timeline) -> WorstCase {
    let mut worst = WorstCase::of(Family::MotorAgainstWheel, Grid::Samples);
    let h = timeline.spacing_s();
    for w in timeline.intervals() {
        for (j, foot) in feet(timeline).filter(|(_, e)| e.contact.actuator().is_some()) {
            let off =
                w.here.sample.end_effectors[j].motor_speed_rad_s - needed_motor_speed(&w, j, h);
            worst.record(off.abs() * foot.radius_m, &w, Some(&foot.name));
        }
    }
    worst
}

/// Speed relative to the link of a wheel that is welded or held still. The residual is a rim speed.
fn held_wheel(timeline: &Timeline) -> WorstCase {
    let mut worst = WorstCase::of(Family::HeldWheel, Grid::Samples);
    let h = timeline.spacing_s();
    let still = timeline.plan.motion.still_wheels(&timeline.plan.robot);
    for w in timeline.intervals() {
        for (j, foot) in feet(timeline) {
            if still[j] {
                let off = needed_motor_speed(&w, j, h).abs() * foot.radius_m;
                worst.record(off, &w, Some(&foot.name));
            }
        }
    }
    worst
}

fn needed_motor_speed(w: &Window, j: usize, h: f64) -> f64 {
    let [here, after] = [w.here, w.after].map(|s: &State| &s.sample.end_effectors[j]);
    let middle =
        |pick: fn(&crate::plan::EndEffectorSample) -> f64| 0.5 * (pick(here) + pick(after));
    let axis = ContactFrame::wheel(1.0, middle(|e| e.tilt_rad), middle(|e| e.yaw_rad)).axis;
    let yaw_rate = (after.yaw_rad - here.yaw_rad) / h;
    here.wheel_speed_rad_s + yaw_rate * axis.z - w.here.link_velocity(j, w.after, h).dot(&axis)
}

/// Excess of joint angles, joint speeds and wheel speeds over their limits.
fn limits(timeline: &Timeline, grid: Grid) -> Vec<WorstCase> {
    let mut angle = WorstCase::of(Family::JointLimit, grid);
    let mut speed = WorstCase::of(Family::JointSpeed, grid);
    let mut wheel = WorstCase::of(Family::WheelMotorSpeed, grid);
    let h = timeline.spacing_s();
    for w in timeline.samples() {
        for (joint, &q) in timeline.plan.robot.joints.iter().zip(&w.here.sample.joint_rad) {
            let beyond = (q - joint.position_max_rad).max(joint.position_min_rad - q).max(0.0);
            angle.record(beyond, &w, Some(&joint.name));
        }
    }
    for w in timeline.intervals() {
        let transmission = timeline.model.tree().transmission();
        let [here, after] =
            [w.here, w.after].map(|state| transmission.motors(&state.sample.joint_rad));
        let angles = here.iter().zip(&after);
        let moving = timeline.plan.robot.joints.iter().zip(angles);
        for (joint, (q, next)) in moving.filter(|(joint, _)| !joint.is_passive()) {
            let limit = joint.actuator.speed_max_rad_s;
            let beyond = (((next - q) / h).abs() - limit).max(0.0);
            speed.record_excess(beyond, limit, &w, Some(&joint.name));
        }
        for (j, foot) in feet(timeline) {
            let Some(motor) = foot.contact.actuator() else { continue };
            let limit = motor.speed_max_rad_s;
            let beyond = (w.here.sample.end_effectors[j].motor_speed_rad_s.abs() - limit).max(0.0);
            wheel.record_excess(beyond, limit, &w, Some(&foot.name));
        }
    }
    vec![angle, speed, wheel]
}

/// Deviation from the goal of the motion: displacement of the centre of mass along and across the initial heading, and turn of
/// the body.
fn goals(timeline: &Timeline) -> Vec<Row> {
    let goal = timeline.plan.motion.goal;
    let [_, last] = timeline.plan.ends();
    let [forward, left, turn] = timeline.plan.reached();
    let displacement = [("forward", goal.forward_m, forward), ("left", goal.left_m, left)];
    let off = |(subject, wanted, reached): (_, Option<f64>, f64)| {
        Some((Some(subject), (reached - wanted?).abs()))
    };
    let worst = displacement.into_iter().filter_map(off).max_by(|a, b| a.1.total_cmp(&b.1));
    let turn = goal.turn_rad.map(|wanted| (None, (turn - wanted).abs()));
    [(Family::DisplacementGoal, worst), (Family::TurningGoal, turn)]
        .into_iter()
        .filter_map(|(family, worst)| {
            let (subject, worst): (Option<&str>, f64) = worst?;
            let place = ResidualLocation {
                sample: timeline.plan.samples.partition_point(|s| s.time_s < last.time_s),
                time_s: last.time_s,
                subject: subject.map(str::to_owned),
            };
            let (_, factor) = family.unit().shown();
            Some(Row {
                worst: worst * factor,
                level: Some(family.level().at(1.0) * factor),
                place: (worst > 0.0).then_some(place),
                ..Row::new(family, Grid::Samples)
            })
        })
        .collect()
}
