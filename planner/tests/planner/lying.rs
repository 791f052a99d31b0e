//! Motions that begin or end with the body on the ground.

use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Sample, Status};
use rollwalk_planner::report::Report;
use rollwalk_planner::{Options, optimise, optimise_transition};
use rollwalk_robot::{GRAVITY_M_S2, Robot};
use std::ops::ControlFlow;

fn robot(name: &str) -> Robot {
    let path = format!("{}/../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Motion file with further keys before its tables.
fn file(keys: &str) -> String {
    format!(
        "name = \"rise\"\nrobot = \"robot.toml\"\nduration_s = 3.0\n{keys}\n[footfalls]\nall = \"stance\""
    )
}

fn read(robot: &Robot, keys: &str) -> Result<Motion, String> {
    Motion::from_toml("rise.toml", &file(keys), robot).map_err(|why| format!("{why:?}"))
}

fn plan(robot: &Robot, keys: &str) -> Plan {
    let motion = read(robot, keys).unwrap();
    let plan = optimise(robot, &motion, &Options::default(), &mut |_| ControlFlow::Continue(()));
    assert_eq!(plan.solve.status, Status::Converged, "{keys}");
    let report = Report::new(&plan);
    assert!(report.judgement.is_good(), "{report}");
    plan
}

const STANDS_UP: &str = "ends = \"at_rest\"\nlying = \"start\"";

/// Sum of the vertical forces on the points of the body, N.
fn on_body_n(plan: &Plan, sample: &Sample) -> f64 {
    let ends = plan.robot.end_effectors.iter().zip(&sample.end_effectors);
    let points = ends.filter(|(end, _)| end.contact.is_body_point());
    points.map(|(_, at)| at.force_n[2]).sum()
}

#[test]
fn a_robot_stands_up_from_its_body_and_lies_down() {
    let robot = robot("anymal_wheels");
    let weight_n = robot.total_mass_kg() * GRAVITY_M_S2;
    let up = plan(&robot, STANDS_UP);
    let down = plan(&robot, "ends = \"at_rest\"\nlying = \"end\"");
    for (plan, low, high) in [(&up, 0, up.samples.len() - 1), (&down, down.samples.len() - 1, 0)] {
        let [low, high] = [low, high].map(|index| &plan.samples[index]);
        // The bottom of the lower box is 0.125 m below the origin. The level of contact heights is 1 mm.
        assert!((low.base_position_m[2] - 0.125).abs() < 2e-4, "{:?}", low.base_position_m);
        assert!(high.base_position_m[2] > 0.45, "{:?}", high.base_position_m);
        let share = on_body_n(plan, low) / weight_n;
        assert!((0.05..0.95).contains(&share), "the body and the feet carry: {share}");
        assert!(on_body_n(plan, high).abs() < 0.2, "the feet carry");
    }
    let feet = robot.end_effectors.len();
    let lies = |plan: &Plan| -> Vec<bool> {
        plan.motion.stance.iter().map(|flags| flags[feet..].iter().all(|&down| down)).collect()
    };
    // A quarter of 45 samples.
    assert_eq!(lies(&up).iter().position(|lies| !lies), Some(12));
    assert_eq!(lies(&down).iter().position(|lies| *lies), Some(33));
    // The plan is complete in its file.
    assert_eq!(Plan::from_json("up.json", &up.to_json()).unwrap(), up);
}

#[test]
fn transitions_join_motions_that_lie_with_motions_that_stand() {
    // The thighs of AgileBot lie beside its body, where a transition cannot move them.
    for name in ["anymal_wheels", "agilebot"] {
        let robot = robot(name);
        joins_lying_with_standing(&robot);
    }
}

fn joins_lying_with_standing(robot: &Robot) {
    let still = "ends = \"at_rest\"";
    let lie = plan(robot, &format!("{still}\nlying = \"throughout\""));
    let stand = plan(robot, still);
    let template =
        Motion { ends: rollwalk_planner::motion::Ends::Prescribed, ..stand.motion.clone() };
    for (from, to) in [(&lie, &stand), (&stand, &lie)] {
        let progress = &mut |_: &_| ControlFlow::Continue(());
        let between = optimise_transition(&template, from, to, &Options::default(), progress);
        let between = between.unwrap();
        assert_eq!(between.solve.status, Status::Converged);
        assert!(Report::new(&between).judgement.is_good());
        let ends = [between.samples.first(), between.samples.last()].map(Option::unwrap);
        for (end, of) in ends.into_iter().zip([from.samples.last(), to.samples.first()]) {
            let off_m = end.base_position_m[2] - of.unwrap().base_position_m[2];
            assert!(off_m.abs() < 1e-6, "{off_m}");
        }
        assert_eq!(between.robot.without_body_points(), *robot);
    }
}

#[test]
fn what_cannot_lie_is_refused_with_the_field_that_helps() {
    let anymal = robot("anymal_wheels");
    let mut bare = anymal.clone();
    bare.links[0].shapes.clear();
    for (robot, keys, words) in [
        (&bare, STANDS_UP, "give link `base` in the robot file `shapes`"),
        (&anymal, "ends = \"periodic\"\nlying = \"start\"", "is given for a periodic motion"),
        (&anymal, &format!("{STANDS_UP}\ntiming = \"free\""), "give `timing = \\\"duration\\\"`"),
        (&anymal, "ends = \"at_rest\"\n[lying_posture]\nLF_HFE = 1.0", "for motions with `lying`"),
        (&robot("pup"), STANDS_UP, "is impossible within the limits of the joints"),
    ] {
        let why = read(robot, keys).unwrap_err();
        assert!(why.contains(words), "{why}");
    }
}

#[test]
fn the_posture_of_a_lying_robot_can_be_given() {
    let robot = robot("anymal_wheels");
    let keys = format!("{STANDS_UP}\n[lying_posture]\nLF_HAA = 0.3");
    let [given, usual] =
        [keys.as_str(), STANDS_UP].map(|keys| read(&robot, keys).unwrap().lying_rad.unwrap());
    assert_eq!(given[0], 0.3);
    // Joints that the table omits have the computed angles.
    assert_eq!(given[1..], usual[1..]);
}
