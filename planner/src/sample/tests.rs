//! Splines and resampling, compared with closed forms: see [`crate::test_plans`].

use super::*;
use crate::test_plans;
use rollwalk_robot::Contact;

fn plans() -> [Plan; 3] {
    [test_plans::start_stop(), test_plans::cruise(), test_plans::cruise_middle()]
}

/// Largest difference between two samples in positions, angles, forces, torques and wheel axes.
fn distance(a: &Sample, b: &Sample) -> f64 {
    let numbers = |s: &Sample| {
        let mut all = [s.base_position_m, s.base_yaw_pitch_roll_rad, s.com_m].concat();
        all.extend(s.base_orientation_wxyz.iter().chain(&s.joint_rad).chain(&s.joint_torque_nm));
        for e in &s.end_effectors {
            all.extend(e.position_m.iter().chain(&e.force_n).chain([&e.tilt_rad, &e.yaw_rad]));
            all.extend(e.motor_torque_nm);
        }
        all
    };
    numbers(a).iter().zip(numbers(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn splines_pass_through_the_samples() {
    for plan in plans() {
        let spline = PlanSpline::new(&plan);
        for sample in &plan.samples {
            let error = distance(&spline.sample(sample.time_s), sample);
            assert!(error < 1e-12, "{} at {}: {error}", plan.motion.name, sample.time_s); // rounding
        }
    }
}

#[test]
fn resampling_keeps_a_plan_valid_and_its_wheel_travel_exact() {
    for plan in plans() {
        let fine = resample(&plan, 60.0);
        fine.validate("resampled").expect("a resampled plan is a plan");
        assert!((1.0 / fine.sample_interval_s - 60.0).abs() < 1e-9);
        let travel = |plan: &Plan| -> f64 {
            let count = match plan.motion.ends {
                Ends::Periodic => plan.samples.len(),
                _ => plan.samples.len() - 1,
            };
            let speeds = plan.samples[..count].iter().map(|s| s.end_effectors[1].motor_speed_rad_s);
            speeds.sum::<f64>() * plan.sample_interval_s
        };
        let (planned, resampled) = (travel(&plan), travel(&fine));
        assert!((planned - resampled).abs() < 1e-9, "{planned} {resampled}"); // rounding of a sum
    }
}

#[test]
fn wheel_travel_over_every_planned_interval_is_preserved() {
    for plan in plans() {
        let spline = PlanSpline::new(&plan);
        let h = plan.sample_interval_s;
        for sample in &plan.samples[..plan.samples.len() - 1] {
            // Simpson's rule is exact for the piecewise quadratic speed.
            let speed = |u: f64| spline.setpoints(sample.time_s + u * h).motor_speed_rad_s[0];
            let mean = (speed(1e-12) + 4.0 * speed(0.5) + speed(1.0 - 1e-12)) / 6.0;
            let error = mean - sample.end_effectors[0].motor_speed_rad_s;
            assert!(error.abs() < 1e-9, "{} at {}: {error}", plan.motion.name, sample.time_s);
        }
    }
}

#[test]
fn a_motion_at_rest_starts_and_ends_with_zero_speeds() {
    let plan = test_plans::start_stop();
    let spline = PlanSpline::new(&plan);
    for time_s in [-1.0, 0.0, plan.motion.duration_s, 9.0] {
        let setpoints = spline.setpoints(time_s);
        let speeds = setpoints.joint_speed_rad_s.iter().chain(&setpoints.motor_speed_rad_s);
        assert!(speeds.fold(0.0, |worst: f64, v| worst.max(v.abs())) < 1e-12, "{setpoints:?}");
    }
}

#[test]
fn a_periodic_motion_goes_on_across_its_seam() {
    let plan = test_plans::cruise();
    let spline = PlanSpline::new(&plan);
    let period = plan.motion.duration_s;
    for k in 0..20 {
        let t = 0.071 * f64::from(k);
        let (first, third) = (spline.sample(t), spline.sample(t + 2.0 * period));
        let step = plan.end_placement.offset_m[0];
        let error = third.base_position_m[0] - first.base_position_m[0] - 2.0 * step;
        assert!(
            error.abs() < 1e-12 && (third.com_m[0] - first.com_m[0] - 2.0 * step).abs() < 1e-12
        );
        assert_eq!(first.end_effectors[0].contact, third.end_effectors[0].contact);
    }
    let (left, right) = (spline.setpoints(period - 1e-9), spline.setpoints(period));
    for (a, b) in left.joint_speed_rad_s.iter().zip(&right.joint_speed_rad_s) {
        assert!((a - b).abs() < 1e-7, "{a} {b}"); // accelerations of 10 rad/s² for 1 ns
    }
}

#[test]
fn a_turning_motion_goes_round_a_circle() {
    // The whole cruise is bent into a circle: samples are turned in proportion to time.
    let mut plan = test_plans::cruise();
    let radius = 0.8;
    let psi = 0.9;
    let count = plan.samples.len() as f64;
    let bend = |sample: &mut Sample, part: f64| {
        let yaw = psi * part;
        sample.base_position_m[0] = radius * yaw.sin();
        sample.base_position_m[1] = radius * (1.0 - yaw.cos());
        sample.base_yaw_pitch_roll_rad = [yaw, 0.0, 0.0];
        sample.base_orientation_wxyz = quaternion_wxyz([yaw, 0.0, 0.0]);
    };
    for (i, sample) in plan.samples.iter_mut().enumerate() {
        bend(sample, i as f64 / count);
    }
    bend(&mut plan.before, -1.0 / count);
    bend(&mut plan.after, 1.0);
    plan.end_placement =
        Placement { offset_m: [radius * psi.sin(), radius * (1.0 - psi.cos())], yaw_rad: psi };
    let (moved, back) = (plan.end_placement, plan.end_placement.inverse());
    let (first, last) = (plan.samples[0].clone(), plan.samples[plan.samples.len() - 1].clone());
    for (outside, inside, placement) in
        [(&mut plan.after, first, moved), (&mut plan.before, last, back)]
    {
        outside.com_m = placement.point(inside.com_m);
        for (to, from) in outside.end_effectors.iter_mut().zip(&inside.end_effectors) {
            to.position_m = placement.point(from.position_m);
            to.force_n = placement.vector(from.force_n);
            to.yaw_rad = from.yaw_rad + placement.yaw_rad;
        }
    }
    plan.validate("circle").expect("a plan");
    let spline = PlanSpline::new(&plan);
    for k in -50..200 {
        let t = 0.03 * f64::from(k);
        let sample = spline.sample(t);
        let [x, y, _] = sample.base_position_m;
        // Spline error on the circle: (5/384)·r·(ψ/24)⁴ = 2e-8 m.
        assert!((x.hypot(y - radius) - radius).abs() < 1e-7, "{t}");
        let yaw = psi * t / plan.motion.duration_s;
        assert!((sample.base_yaw_pitch_roll_rad[0] - yaw).abs() < 1e-12, "{t}");
        assert!((x - radius * yaw.sin()).abs() < 1e-6, "{t}");
    }
}

#[test]
fn a_prescribed_motion_takes_its_end_speeds_from_the_samples_around() {
    // The same cruise, once complete, and once a part with prescribed ends.
    let (whole, part) =
        (PlanSpline::new(&test_plans::cruise()), PlanSpline::new(&test_plans::cruise_middle()));
    for k in 0..=60 {
        let t = 0.01 * f64::from(k);
        let (a, b) = (whole.setpoints(t + 0.3), part.setpoints(t));
        // Leg sine of 0.2 rad at 5.2 rad/s: a cubic's slope errs by about h³/24·0.2·5.2⁴ = 8e-4.
        assert!((a.joint_rad[0] - b.joint_rad[0]).abs() < 2e-5, "{t}");
        assert!((a.joint_speed_rad_s[0] - b.joint_speed_rad_s[0]).abs() < 2e-3, "{t}");
        // The wheel's speed outside is the mean over an interval on which the leg, 4 wheel radii long, turns evenly
        // at 0.8 rad/s: its error is h/2·4·0.8²·sin(leg) = 3e-2.
        assert!((a.motor_speed_rad_s[0] - b.motor_speed_rad_s[0]).abs() < 4e-2, "{t}");
    }
}

#[test]
fn force_and_contact_switch_between_stance_and_swing() {
    let mut plan = test_plans::cruise();
    for i in [5, 6, 7] {
        plan.motion.stance[i][2] = false;
        plan.samples[i].end_effectors[2].contact = false;
        plan.samples[i].end_effectors[2].force_n = [0.0; 3];
    }
    let spline = PlanSpline::new(&plan);
    let h = plan.sample_interval_s;
    let at = |sample: f64| spline.sample(sample * h).end_effectors[2].clone();
    assert!(
        at(4.0).contact
            && !at(4.5).contact
            && !at(5.0).contact
            && !at(7.9).contact
            && at(8.0).contact
    );
    let half = 0.5 * plan.samples[4].end_effectors[2].force_n[2];
    assert!((at(4.5).force_n[2] - half).abs() < 1e-9);
    assert_eq!(at(6.3).force_n, [0.0; 3]);
}

#[test]
fn welded_wheels_spin_with_their_links() {
    let mut plan = test_plans::cruise();
    let axis_in_link = Vector3::y();
    plan.robot.end_effectors[1].contact = Contact::WeldedWheel { axis_in_link };
    let spline = PlanSpline::new(&plan);
    for k in 0..50 {
        // The box neither tilts nor yaws, so the wheel rotates as its leg does. The bound allows only for rounding.
        let time_s = 0.0237 * f64::from(k);
        let spin = spline.sample(time_s).end_effectors[1].wheel_speed_rad_s;
        let leg = spline.setpoints(time_s).joint_speed_rad_s[1];
        assert!((spin - leg).abs() < 1e-12, "{time_s}: {spin} {leg}");
    }
    // New intervals lie within old ones, where Simpson's rule is exact for the spline's rate.
    let fine = resample(&plan, 60.0);
    for pair in fine.samples.windows(2) {
        let turned = (pair[1].joint_rad[1] - pair[0].joint_rad[1]) / fine.sample_interval_s;
        let end_effector = &pair[0].end_effectors[1];
        assert!((end_effector.wheel_speed_rad_s - turned).abs() < 1e-9);
        assert_eq!(end_effector.motor_speed_rad_s, 0.0);
    }
}

#[test]
fn the_spin_of_a_welded_wheel_leaves_out_the_yaw_of_its_axis() {
    let mut plan = test_plans::cruise();
    plan.robot.end_effectors[1].contact =
        Contact::WeldedWheel { axis_in_link: Vector3::new(0.0, 0.8, 0.6) };
    let spline = PlanSpline::new(&plan);
    for k in 0..20 {
        let time_s = 0.0537 * f64::from(k);
        // Ry(φ) (0, 0.8, 0.6): heading and elevation of the axis, and their change with the leg's angle.
        let (sin, cos) = spline.sample(time_s).joint_rad[1].sin_cos();
        let leg = spline.setpoints(time_s).joint_speed_rad_s[1];
        let yaw_rate = -0.6 * cos * leg * 0.8 / ((0.6 * sin).powi(2) + 0.64);
        let expected = 0.8 * leg - yaw_rate * 0.6 * cos;
        let spin = spline.sample(time_s).end_effectors[1].wheel_speed_rad_s;
        assert!((spin - expected).abs() < 1e-12, "{time_s}: {spin} {expected}"); // rounding only
    }
}
