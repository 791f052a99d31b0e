//! Free times of motions: cheaper plans, plans of requests that are too fast as given, and the record of the choice.

use rollwalk_planner::motion::{FreeTimes, Goal, Motion, Timing};
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::plot::{JointPanels, figure};
use rollwalk_planner::report::Report;
use rollwalk_planner::{Options, Progress, optimise_solution, timing};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

fn on(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Shipped robot and motion.
macro_rules! shipped {
    ($robot:literal, $motion:literal) => {{
        let text = include_str!(concat!("../../../shipped/robots/", $robot));
        let robot = Robot::from_toml($robot, text).unwrap();
        let text = include_str!(concat!("../../../shipped/motions/", $motion));
        let motion = Motion::from_toml($motion, text, &robot).unwrap();
        (robot, motion)
    }};
}

/// Motion with a lower speed limit of all joints.
fn slowed((mut robot, motion): (Robot, Motion), speed_max_rad_s: f64) -> (Robot, Motion) {
    for joint in &mut robot.joints {
        joint.actuator.speed_max_rad_s = speed_max_rad_s;
    }
    (robot, motion)
}

fn freed(motion: &Motion, free: FreeTimes) -> Motion {
    Motion { timing: Timing { free, ..Timing::default() }, ..motion.clone() }
}

fn chosen(robot: &Robot, motion: &Motion, free: FreeTimes) -> Plan {
    let motion = freed(motion, free);
    let plan = timing::choose(robot, &motion, &Options::default(), &mut on).unwrap().plan;
    assert_eq!(plan.solve.status, Status::Converged);
    assert!(Report::new(&plan).judgement.is_good());
    let range = motion.frames_allowed();
    assert!(range.contains(&plan.motion.frames()), "{} s", plan.motion.duration_s);
    plan
}

fn cost(plan: &Plan) -> f64 {
    plan.solve.timing.as_ref().unwrap().chosen.cost
}

#[test]
fn free_times_lower_the_costs_of_walks_that_hold_as_well_as_given() {
    for (robot, motion) in
        [shipped!("agilebot.toml", "walk.toml"), shipped!("agilebot.toml", "trot.toml")]
    {
        let [duration, free] =
            [FreeTimes::Duration, FreeTimes::Free].map(|times| chosen(&robot, &motion, times));
        let timing = duration.solve.timing.clone().unwrap();
        let given = timing.given.unwrap();
        assert_eq!(timing.given_duration_s, motion.duration_s);
        assert_eq!(
            (&timing.given_stance, &duration.motion.stance),
            (&motion.stance, &motion.stance)
        );
        assert!(timing.chosen.cost < 0.95 * given.cost, "{timing:?}");
        assert!(cost(&free) < 0.99 * cost(&duration), "{} {}", cost(&free), cost(&duration));
        for plan in [&duration, &free] {
            let as_played = plan.solve.timing.as_ref().unwrap().chosen.as_played;
            assert!(as_played <= given.as_played.max(0.5), "{as_played} {}", given.as_played);
        }
        // Swings keep five samples, and the same feet step.
        assert_ne!(free.motion.stance, motion.stance);
        for j in 0..4 {
            assert!(free.motion.stance.iter().filter(|feet| !feet[j]).count() >= 5);
        }
    }
}

#[test]
fn a_walk_that_is_too_fast_as_given_takes_longer() {
    let (robot, motion) = slowed(shipped!("pup.toml", "pup_walk.toml"), 2.6);
    let goal = Goal { forward_m: Some(0.12), ..motion.goal };
    let motion = Motion { goal, ..motion.stretched(0.8) };
    let plan = chosen(&robot, &motion, FreeTimes::Duration);
    assert!(plan.motion.duration_s > 0.85, "{}", plan.motion.duration_s);
    let report = Report::new(&plan);
    assert_eq!(report.timing.as_ref().unwrap().given, None);
    let words = report.words(&plan.solve);
    assert!(words.contains("instead of 0.800 s"), "{words}");
    assert!(words.contains("no plan was found with the given times"), "{words}");
}

#[test]
fn a_trot_that_is_too_fast_for_any_duration_takes_longer_swings() {
    let (robot, motion) = slowed(shipped!("agilebot.toml", "trot.toml"), 2.0);
    let motion = motion.stretched(0.4);
    let lengthened = freed(&motion, FreeTimes::Duration);
    assert!(timing::choose(&robot, &lengthened, &Options::default(), &mut on).is_none());
    let plan = chosen(&robot, &motion, FreeTimes::Free);
    let swing = |motion: &Motion| motion.stance.iter().filter(|feet| !feet[0]).count();
    assert!(swing(&plan.motion) > swing(&motion), "{}", swing(&plan.motion));
}

#[test]
fn a_drive_on_wheels_takes_the_longest_time() {
    let (robot, motion) = shipped!("agilebot.toml", "drive_1m.toml");
    let plan = chosen(&robot, &motion, FreeTimes::Free);
    // Costs of a drive fall with its accelerations.
    assert_eq!(plan.motion.frames(), *motion.frames_allowed().end());
    assert_eq!(plan.motion.stance, motion.stance);
}

#[test]
fn given_times_are_planned_as_before() {
    let (robot, motion) = shipped!("agilebot.toml", "drive_1m.toml");
    let options = Options::default();
    assert!(timing::choose(&robot, &motion, &options, &mut on).is_none());
    let plan = timing::optimise(&robot, &motion, &options, &mut on).plan;
    assert_eq!(plan, optimise_solution(&robot, &motion, &options, &mut on).plan);
    let text = plan.to_json();
    assert!(!text.contains("timing"), "{text}");
}

#[test]
fn a_request_without_a_plan_for_any_times_has_a_diagnosis() {
    let (robot, motion) = shipped!("car.toml", "car_drive.toml");
    let sideways = Goal { left_m: Some(0.3), ..motion.goal };
    let motion = freed(&Motion { goal: sideways, ..motion }, FreeTimes::Duration);
    let plan = timing::optimise(&robot, &motion, &Options::default(), &mut on).plan;
    assert_eq!((plan.solve.status, &plan.solve.timing), (Status::Infeasible, &None));
    assert!(plan.solve.diagnosis.is_some());
    assert_eq!(plan.motion.duration_s, motion.duration_s);
}

#[test]
fn a_stopped_search_keeps_its_best_plan() {
    let (robot, motion) = shipped!("agilebot.toml", "walk.toml");
    let motion = freed(&motion, FreeTimes::Free);
    let stops_after = |most: usize| {
        let mut seen = 0;
        let progress = &mut |_: &Progress| {
            seen += 1;
            if seen < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        timing::choose(&robot, &motion, &Options::default(), progress)
    };
    assert!(stops_after(3).is_none(), "no plan yet");
    let plan = stops_after(10).unwrap().plan;
    assert_eq!((plan.solve.status, plan.motion.duration_s), (Status::Converged, 1.6));
}

#[test]
fn the_choice_is_in_the_plan_and_drawn_against_the_request() {
    let (robot, motion) = shipped!("agilebot.toml", "trot.toml");
    let plan = chosen(&robot, &motion, FreeTimes::Free);
    let text = plan.to_json();
    assert_eq!(Plan::from_json("plan.json", &text).unwrap(), plan);
    let outlined = |svg: &str| svg.matches("fill=\"none\" height").count();
    let svg = figure(&plan, JointPanels::Limb);
    assert!(svg.contains("footfalls (outlined: as given, in 0.80 s)"));
    let mut given = plan.clone();
    given.solve.timing = None;
    assert!(outlined(&svg) > outlined(&figure(&given, JointPanels::Limb)), "{svg}");

    let at = text.find("\"given_duration_s\": 0.8").unwrap();
    let broken = format!("{}{}", &text[..at], text[at..].replacen("0.8", "-0.8", 1));
    let error = Plan::from_json("plan.json", &broken).unwrap_err().to_string();
    assert!(error.contains("solve.timing.given_duration_s"), "{error}");
}
