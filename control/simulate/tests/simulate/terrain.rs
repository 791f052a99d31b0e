//! Tests of motions that are planned for a terrain and played on it.

use crate::robot;
use rollwalk_multibody::ground::file::from_toml;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Sample, Status};
use rollwalk_planner::report::Report;
use rollwalk_planner::{Options, optimise};
use rollwalk_simulate::{Control, Feedback, Verdict, play};
use std::ops::ControlFlow;

/// Motion in which AgileBot walks with held wheels.
fn walk(forward_m: f64, cycles: u32) -> String {
    let duration_s = 1.6 * (f64::from(cycles) + 0.5);
    let samples = 20 * (2 * cycles + 1);
    format!(
        "name = \"climb\"\nrobot = \"agilebot.toml\"\nterrain = \"terrain.toml\"\nends = \"at_rest\"\n\
         duration_s = {duration_s}\nsamples = {samples}\nswing_height_m = 0.03\nwheels = \"held\"\n\
         [goal]\nforward_m = {forward_m}\nleft_m = 0.0\nturn_rad = 0.0\n\
         [footfalls]\ngait = \"walk\"\nduty = 0.8\ncycles = {cycles}\n"
    )
}

fn planned(motion: &str, terrain: &str) -> Plan {
    let robot = robot("agilebot");
    let terrain = from_toml("terrain.toml", terrain).unwrap();
    let motion = Motion::from_toml_on("climb.toml", motion, &robot, Some(&terrain)).unwrap();
    let options = Options { refine: false, ..Options::default() };
    let plan = optimise(&robot, &motion, &options, &mut |_| ControlFlow::Continue(()));
    assert_eq!(plan.solve.status, Status::Converged, "{:?}", plan.solve);
    plan
}

/// Mean displacement of the contact points from the start to the end of a plan, along x and up, m.
fn moved_m(plan: &Plan) -> [f64; 2] {
    let [first, last] = plan.ends();
    [0, 2].map(|axis| {
        let place_m = |sample: &Sample| {
            let places = sample.end_effectors.iter().map(|end| end.position_m[axis]);
            places.sum::<f64>() / sample.end_effectors.len() as f64
        };
        place_m(last) - place_m(first)
    })
}

#[test]
fn a_step_is_climbed_open_loop_and_tracked() {
    let step = planned(&walk(0.6, 5), "[step]\nat_x_m = 0.3\nheight_m = 0.03");
    let [_, rise_m] = moved_m(&step);
    assert!((rise_m - 0.03).abs() < 0.001, "{rise_m}");
    let mut go_on = |_: f64| true;
    assert_eq!(Verdict::of(&step, &mut go_on), Some(Verdict::Holds));
    let report = Report::new(&step);
    let foothold = report.rows.iter().find(|row| row.family.name() == "foothold").unwrap();
    assert!(foothold.worst < 1.0, "{report}");

    // The file contains the terrain, and what is read from it plays alike.
    let read = Plan::from_json("step.json", &step.to_json()).unwrap();
    assert_eq!(read.motion, step.motion);
    let control = Control::Tracking(Feedback::Gains);
    let options = rollwalk_simulate::Options::new(control, control.usual_rate_hz());
    let tracked = play(&read, &options, |_| true).unwrap();
    assert!((tracked.ratio(0).unwrap() - 1.0).abs() < 0.01, "{tracked:?}");
}

#[test]
fn a_slope_is_walked_up_in_the_frame_of_the_world() {
    let slope = planned(&walk(0.24, 2), "[slope]\nangle_deg = 8");
    let [forward_m, rise_m] = moved_m(&slope);
    assert!(forward_m > 0.1);
    assert!((rise_m - forward_m * 8f64.to_radians().tan()).abs() < 1e-4, "{forward_m} {rise_m}");
    assert_eq!(Verdict::of(&slope, |_| true), Some(Verdict::Holds));
}
