//! Transitions without footfalls in the library file: feet that cannot roll step.

use rollwalk_planner::building::{Contents, LibraryFiles, LibraryMismatch};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::{Options, optimise, optimise_transition};
use rollwalk_robot::Robot;
use rollwalk_robot::document::DocumentError;
use std::ops::ControlFlow;

const ROBOT: &str = include_str!("../../../shipped/robots/legbot.toml");
const STAND: &str = include_str!("../../../shipped/motions/stand.toml");
const WALK: &str = include_str!("../../../shipped/motions/legbot_walk.toml");
const LIBRARY: &str = "name = \"legs\"\nrobot = \"../robots/legbot.toml\"\nsafe = \"stand\"\n\
    [[motion]]\nname = \"stand\"\nfile = \"stand.toml\"\ncode = 1\n\
    [[motion]]\nname = \"duck\"\nfile = \"stand.toml\"\ncode = 2\n\
    [[motion]]\nname = \"walk\"\nfile = \"GAIT\"\ncode = 3\n\
    [via_safe]\nduration_s = 1.6\n";

/// Files of LegBot: a stand, its walk and a trot.
struct Files;

impl LibraryFiles for Files {
    type Error = DocumentError;

    fn robot(&mut self, named: &str) -> Result<(Robot, String), DocumentError> {
        Ok((Robot::from_toml(named, ROBOT)?, named.to_owned()))
    }

    fn motion(&mut self, named: &str) -> Result<(Robot, Motion, String), DocumentError> {
        let robot = Robot::from_toml("legbot.toml", ROBOT)?;
        let text = match named {
            "stand.toml" => STAND.replace("agilebot.toml", "legbot.toml"),
            "trot" => WALK.replace("gait = \"walk\"", "gait = \"trot\""),
            _ => WALK.to_owned(),
        };
        let motion = Motion::from_toml(named, &text, &robot)?;
        Ok((robot, motion, named.to_owned()))
    }

    fn plan(&mut self, _: &str) -> Result<(Plan, String), DocumentError> {
        unreachable!("the library names no plans")
    }

    fn faults(&mut self, error: DocumentError) -> DocumentError {
        error
    }

    fn misfit(&mut self, error: LibraryMismatch) -> DocumentError {
        panic!("{error}")
    }
}

fn contents(gait: &str) -> Contents {
    Contents::read("legs.toml", &LIBRARY.replace("GAIT", gait), &mut Files).unwrap()
}

/// Pattern of `#` and `.` of each end effector in a transition.
fn rows(contents: &Contents, from: usize, to: usize) -> Vec<String> {
    let wanted =
        contents.file.transitions.iter().find(|of| (of.from, of.to) == (from, to)).unwrap();
    let stance = &wanted.motion.stance;
    // The library file does not name the gait's duration.
    let steps = stance.iter().flatten().any(|stands| !stands);
    assert_eq!(wanted.motion.swing_height_m > 0.0, steps);
    let row =
        |foot: usize| stance.iter().map(|flags| if flags[foot] { '#' } else { '.' }).collect();
    (0..stance[0].len()).map(row).collect()
}

#[test]
fn each_foot_of_a_gait_steps_once_in_the_order_in_which_it_lifts_them() {
    let walk = contents("walk");
    let order = &walk.motions[2].stance;
    let lifted = |foot: usize| order.iter().position(|row| !row[foot]).unwrap();
    for (from, to) in [(0, 2), (2, 0)] {
        let rows = rows(&walk, from, to);
        let mut begins: Vec<_> = rows.iter().map(|row| row.find('.').unwrap()).collect();
        for row in &rows {
            assert!(row.starts_with("##") && row.ends_with("##"), "{rows:#?}");
            assert_eq!(row.trim_matches('#').len(), 5, "{rows:#?}");
            assert!(!row.trim_matches('#').contains('#'), "{rows:#?}");
        }
        let mut feet = [0, 1, 2, 3];
        feet.sort_by_key(|&foot| begins[foot]);
        assert!(feet.is_sorted_by_key(|&foot| lifted(foot)), "{rows:#?}");
        // The feet step one after the other.
        begins.sort_unstable();
        assert!(begins.windows(2).all(|pair| pair[1] == pair[0] + 5), "{rows:#?}");
    }
}

#[test]
fn feet_stay_between_motions_that_keep_them_down() {
    for row in rows(&contents("walk"), 0, 1) {
        assert!(!row.contains('.'), "{row}");
    }
}

#[test]
fn walks_and_trots_of_feet_are_joined_with_a_stand() {
    for gait in ["walk", "trot"] {
        let contents = contents(gait);
        let on = &mut |_: &_| ControlFlow::Continue(());
        let plans: Vec<Plan> = contents
            .motions
            .iter()
            .map(|motion| optimise(&contents.robot, motion, &Options::default(), on))
            .collect();
        for (from, to) in [(0, 2), (2, 0)] {
            let mut all = contents.file.transitions.iter();
            let wanted = all.find(|of| (of.from, of.to) == (from, to)).unwrap();
            let options = Options::default();
            let joined =
                optimise_transition(&wanted.motion, &plans[from], &plans[to], &options, on);
            assert_eq!(joined.unwrap().solve.status, Status::Converged, "{gait}, {from} to {to}");
        }
    }
}
