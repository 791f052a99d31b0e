//! The report against `docs/check_plan.py`, which shares no code with it: another language, other
//! kinematics, the same equations.

use super::{Grid, Report};
use crate::formulation::TERMS;
use crate::plan::{Plan, Sample};
use crate::{motion::Motion, optimise, test_plans, test_robots};
use rollwalk_robot::{Actuator, Contact, Robot, RollingDrag, TorqueSpeedLine};
use serde_json::Value;
use std::io::Write;
use std::ops::ControlFlow;
use std::process::{Command, Stdio};

/// Exit code and table of the script.
fn check_plan(plan: &Plan) -> (Option<i32>, Value) {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/check_plan.py");
    let mut child = Command::new("python3")
        .args([script, "--json", "/dev/stdin"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("python3 runs docs/check_plan.py; on Debian: apt-get install -y python3");
    child
        .stdin
        .take()
        .expect("piped")
        .write_all(plan.to_json().as_bytes())
        .expect("the script reads");
    let output = child.wait_with_output().expect("the script ends");
    let table = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (output.status.code(), table)
}

/// What a solve has no term for: the centre of mass and the motors are functions of its variables, feet in
/// swing follow their profile, and wheels that land are rows of the slip.
const REPORTED_ONLY: [&str; 4] =
    ["centre of mass", "motor against wheel", "depth in swing", "landing slip"];

/// Moves every number of a plan a little, so that every residual is something.
fn shaken(mut plan: Plan) -> Plan {
    let mut random = test_robots::uniform(5);
    let mut shake = |value: &mut f64, by: f64| *value += by * random();
    let mut shake_sample = |s: &mut Sample| {
        s.com_m.iter_mut().for_each(|v| shake(v, 1e-3));
        s.joint_rad.iter_mut().for_each(|v| shake(v, 0.3));
        for e in &mut s.end_effectors {
            e.position_m.iter_mut().for_each(|v| shake(v, 1e-3));
            e.force_n.iter_mut().for_each(|v| shake(v, 30.0));
            shake(&mut e.tilt_rad, 0.1);
            shake(&mut e.yaw_rad, 0.1);
            shake(&mut e.wheel_speed_rad_s, 3.0);
            shake(&mut e.motor_speed_rad_s, 30.0);
        }
    };
    plan.samples.iter_mut().for_each(&mut shake_sample);
    shake_sample(&mut plan.before);
    shake_sample(&mut plan.after);
    plan
}

fn planned(robot: &str, motion: &str) -> Plan {
    let robot = Robot::from_toml("robot", robot).expect("a shipped robot");
    let motion = Motion::from_toml("motion", motion, &robot).expect("a shipped motion");
    optimise(&robot, &motion, &Default::default(), &mut |_| ControlFlow::Continue(()))
}

fn walk() -> Plan {
    planned(
        include_str!("../../../robots/agilebot.toml"),
        include_str!("../../../motions/walk.toml"),
    )
}

/// A plan on one wheel of every kind, with motors too weak for it.
fn of_every_kind() -> Plan {
    let mut plan = test_plans::cruise();
    let line = TorqueSpeedLine { stall_torque_nm: 0.8, no_load_speed_rad_s: 7.0 };
    let weak = |motor: &mut Actuator| {
        (motor.torque_max_nm, motor.torque_speed) = (0.5, Some(line));
    };
    plan.robot.joints.iter_mut().for_each(|joint| weak(&mut joint.actuator));
    let drag = RollingDrag { rolling_resistance: 0.02, rolling_drag_s_m: 0.1 };
    let axis_in_link = nalgebra::Vector3::y();
    let ends = &mut plan.robot.end_effectors;
    ends[1].contact = Contact::WeldedWheel { axis_in_link };
    ends[2].contact = Contact::Skate { axis_in_link, blade_length_m: 0.02, drag };
    ends[3].contact = Contact::PassiveWheel { axis_in_link, drag };
    for (flags, sample) in plan.motion.stance.iter_mut().zip(&mut plan.samples).skip(6).take(5) {
        flags[3] = false;
        sample.end_effectors[3].contact = false;
    }
    weak(ends[0].contact.actuator_mut().expect("a driven wheel"));
    // Choreography on and between samples, with the half intervals at the ends.
    plan.motion.targets = test_robots::targets();
    plan.motion.heights = test_robots::heights();
    plan
}

#[test]
fn an_optimised_walk_passes_both_opinions() {
    let plan = walk();
    let report = Report::new(&plan);
    assert!(report.is_credible(), "{report}");
    let (code, table) = check_plan(&plan);
    assert_eq!(code, Some(0), "{table:#}");
}

#[test]
fn both_opinions_agree_on_the_size_of_every_residual() {
    let plans = [walk(), test_plans::start_stop(), test_plans::cruise_middle(), of_every_kind()];
    let mut names = std::collections::BTreeSet::new();
    for plan in plans.map(shaken) {
        let report = Report::new(&plan);
        let (code, table) = check_plan(&plan);
        assert_eq!(code, Some(1), "{table:#}");
        let mut compared = 0;
        for row in report.rows.iter().filter(|row| row.grid == Grid::Samples) {
            let worst = table[row.name]["worst"]
                .as_f64()
                .unwrap_or_else(|| panic!("no row {}: {table:#}", row.name));
            // Two ways of rounding the same formulas.
            let error = (worst - row.worst).abs() / row.worst.max(1e-6);
            assert!(error < 1e-9, "{}: {worst} {}", row.name, row.worst);
            compared += 1;
        }
        assert!(compared >= 12, "{report}");
        names.extend(report.rows.iter().filter(|row| row.worst > 0.0).map(|row| row.name));
    }
    // One vocabulary: what a term is called in a solve is what it is called here.
    for name in names.iter().filter(|name| !REPORTED_ONLY.contains(name)) {
        assert!(TERMS.iter().any(|term| term.about().name == *name), "no term is called {name}");
    }
    for name in [
        "held wheel",
        "contact on the blade",
        "landing slip",
        "joint torque",
        "wheel torque",
        "torque-speed line",
        "target position",
        "target velocity",
        "target heading",
        "height limit",
    ] {
        assert!(names.contains(name), "no plan has a residual of {name}: {names:?}");
    }
}
