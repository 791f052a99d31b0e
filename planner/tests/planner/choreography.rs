//! Targets, height limits and phases: reading and refusal of motion files, and plans that meet them.

use rollwalk_planner::motion::{Motion, Subject};
use rollwalk_planner::plan::{Plan, Sample, Status};
use rollwalk_planner::report::{Judgement, Report};
use rollwalk_planner::sample::PlanSpline;
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::Robot;
use rollwalk_robot::document::DocumentError;
use std::ops::ControlFlow;

const SLALOM: &str = include_str!("../../../shipped/motions/slalom.toml");
const DUCK: &str = include_str!("../../../shipped/motions/duck.toml");
const WALK: &str = include_str!("../../../shipped/motions/walk.toml");
const DRIVE: &str = include_str!("../../../shipped/motions/drive_1m.toml");
const TURN: &str = include_str!("../../../shipped/motions/turn_in_place.toml");

fn agilebot() -> Robot {
    let text = include_str!("../../../shipped/robots/agilebot.toml");
    Robot::from_toml("robots/agilebot.toml", text).unwrap()
}

fn creature3() -> Robot {
    let text = include_str!("../../../shipped/robots/creature3.toml");
    Robot::from_toml("robots/creature3.toml", text).unwrap()
}

/// Reads a motion with more tables at its end.
fn with(text: &str, tables: &str) -> Result<Motion, DocumentError> {
    Motion::from_toml("m.toml", &format!("{text}\n{tables}\n"), &agilebot())
}

fn plan(motion: &Motion) -> Plan {
    let plan =
        optimise(&agilebot(), motion, &Options::default(), &mut |_| ControlFlow::Continue(()));
    assert_eq!(plan.solve.status, Status::Converged, "{}: {:?}", motion.name, plan.solve);
    plan
}

/// Asserts that the motion with the given tables has exactly one fault, with the given message and help.
fn refused(text: &str, tables: &str, message: &str, help: &str) {
    let faults: Vec<_> = match with(text, tables) {
        Ok(_) => panic!("accepted: {tables}"),
        Err(error) => error.faults().map(|f| (f.line, f.message.clone(), f.help.clone())).collect(),
    };
    let [(line, found, found_help)] = &faults[..] else { panic!("{tables}: {faults:#?}") };
    assert!(*line > text.lines().count(), "{found} at line {line}");
    assert!(found.contains(message), "{found:?} lacks {message:?}");
    assert!(found_help.contains(help), "{found_help:?} lacks {help:?}");
}

#[test]
fn targets_and_heights_are_read() {
    let tables = "[[target]]\nof = \"com\"\nat_s = 0.81\nforward_m = 0.06\nspeed_left_m_s = -0.01\n\
                  [[target]]\nof = \"front_left\"\nat_s = 0.6\nup_m = 0.05\n\
                  [[target]]\nof = \"body\"\nat_s = 1.6\nheading_rad = 0.1\n\
                  [[height]]\nof = \"body\"\nfrom_s = 0.2\nto_s = 0.4\nabove_m = 0.2\nbelow_m = 0.3\n\
                  [[height]]\nof = \"com\"\nbelow_m = 0.4";
    let motion = with(WALK, tables).unwrap();
    let [com, foot, body] = &motion.targets[..] else { panic!("{:?}", motion.targets) };
    assert_eq!((com.of, com.at_s), (Subject::Com, 0.81));
    assert_eq!(com.position_m, [Some(0.06), None, None]);
    assert_eq!(com.velocity_m_s, [None, Some(-0.01), None]);
    assert_eq!((foot.of, foot.position_m[2]), (Subject::EndEffector(0), Some(0.05)));
    assert_eq!((body.of, body.heading_rad), (Subject::Body, Some(0.1)));
    let [span, always] = &motion.heights[..] else { panic!("{:?}", motion.heights) };
    assert_eq!((span.from_s, span.to_s), (0.2, 0.4));
    assert_eq!((span.above_m, span.below_m), (Some(0.2), Some(0.3)));
    assert_eq!((always.from_s, always.to_s, always.of), (0.0, 1.6, Subject::Com));
}

#[test]
fn faulty_targets_say_what_would_be_right() {
    let target = |rest: &str| format!("[[target]]\n{rest}");
    for (rest, message, help) in [
        ("of = \"front_lft\"\nat_s = 0.5\nleft_m = 0.1", "front_lft", "did you mean `front_left`"),
        ("of = \"com\"\nat_s = 1.7\nleft_m = 0.1", "`at_s` is 1.7", "0 to 1.6"),
        (
            "of = \"com\"\nat_s = 0.5",
            "com at 0.5 s has no position, speed or heading",
            "forward_m, left_m, up_m",
        ),
        ("of = \"com\"\nat_s = 0.5\nup_m = 0.3\nleft = 0.1", "unknown key `left`", "left_m"),
        ("of = \"com\"\nat_s = 0.5\nheading_rad = 1", "without a heading", "of = \"body\""),
        (
            "of = \"body\"\nat_s = 0.0\nleft_m = 0.1",
            "`left_m` is 0.1 at time 0",
            "choose a later time",
        ),
        ("of = \"body\"\nat_s = 0.5\nup_m = 1.5", "`up_m` is 1.5 m", "on the ground at 0.50 s"),
        ("of = \"com\"\nat_s = 0.5\nup_m = -0.1", "`up_m` is -0.1", "above the ground"),
        ("of = \"front_left\"\nat_s = 0.6\nspeed_up_m_s = 1", "end effector", "`up_m`"),
        (
            "of = \"front_left\"\nat_s = 0.2\nup_m = 0.05",
            "while `front_left` is on the ground",
            "0.45 to 0.75 s",
        ),
        (
            "of = \"front_left\"\nat_s = 0.6\nup_m = 0.0",
            "0 while `front_left` swings",
            "leave out `up_m`",
        ),
        ("of = \"front_left\"\nat_s = 0.45\nup_m = 0.3", "too close to an end", "above 1 m"),
    ] {
        refused(WALK, &target(rest), message, help);
    }
    let at_end = "of = \"com\"\nat_s = 4.0\nspeed_forward_m_s = 0.1";
    refused(DRIVE, &target(at_end), "is given for an end", "between the ends");
    let far = "of = \"com\"\nat_s = 1.0\nforward_m = 4.0";
    refused(
        DRIVE,
        &target(far),
        "`at_s` is 1 s",
        "4.00 m in 1.00 s is too far with `front_left` on the ground",
    );
}

#[test]
fn what_contradicts_something_above_is_refused() {
    let up = |m: f64| format!("[[target]]\nof = \"front_left\"\nat_s = {m}\nup_m = 0.05\n");
    refused(
        WALK,
        &(up(0.55) + &up(0.6)),
        "swing whose height an earlier target determines",
        "one `up_m`",
    );
    let left = "[[target]]\nof = \"com\"\nat_s = 0.5\nleft_m = 0.01\n";
    refused(WALK, &left.repeat(2), "`at_s` is 0.5 s, as in an earlier target", "another time");
    let height = |rest: &str| format!("[[height]]\nof = \"body\"\n{rest}\n");
    let (low, high) = (height("from_s = 0.2\nto_s = 0.5\nbelow_m = 0.2"), height("above_m = 0.25"));
    refused(WALK, &(low.clone() + &high), "`above_m` is 0.25 m", "below 0.2 m from 0.2 to 0.5 s");
    let target = "[[target]]\nof = \"body\"\nat_s = 0.4\nup_m = 0.25\n";
    refused(
        WALK,
        &format!("{low}{target}"),
        "`up_m` is 0.25 m",
        "below 0.2 m, the bound of a [[height]] from 0.2 to 0.5 s",
    );
    for (rest, message, help) in [
        ("from_s = 0.5\nto_s = 0.2\nbelow_m = 0.2", "`to_s` is 0.2 s, before", "give 0.5 s"),
        ("from_s = 0.5", "height of body has no bound", "`above_m`, `below_m`"),
        ("above_m = 0.3\nbelow_m = 0.2", "`below_m` is 0.2 m, lower", "give `above_m`, 0.3 m"),
        ("above_m = 2.0", "`above_m` is 2 m", "allows at most"),
    ] {
        refused(WALK, &height(rest), message, help);
    }
    let foot = "[[height]]\nof = \"front_left\"\nbelow_m = 0.1";
    refused(WALK, foot, "is the end effector \"front_left\"", "`up_m` of a [[target]]");
    refused(WALK, "[[height]]\nof = \"bdy\"\nbelow_m = 0.1", "\"bdy\"", "did you mean `body`");
}

#[test]
fn standing_point_feet_do_not_move() {
    let text = "name = \"m\"\nrobot = \"r\"\nduration_s = 1.0\nends = \"periodic\"\nsamples = 20\n\
                swing_height_m = 0.02\n[footfalls]\ngait = \"walk\"\nduty = 0.75\n[[target]]\n\
                of = \"front_left\"\nat_s = 0.8\nspeed_forward_m_s = ";
    let read = |speed: &str| Motion::from_toml("m.toml", &format!("{text}{speed}\n"), &creature3());
    assert!(read("0.0").is_ok());
    let error = read("0.1").unwrap_err();
    let fault = error.faults().next().unwrap();
    assert!(
        fault.message.contains("cannot move while it is on the ground")
            && fault.help.contains("0.30 to 0.45 s"),
        "{error}"
    );
}

#[test]
fn phases_say_when_feet_touch_down() {
    let phases = |rest: &str| {
        let start = WALK.find("[footfalls]").unwrap();
        Motion::from_toml(
            "m.toml",
            &format!("{}[footfalls]\n{rest}\n", &WALK[..start]),
            &agilebot(),
        )
    };
    // The walk's feet touch down one tenth of a cycle after the middles of their swings.
    let walk = "duty = 0.8\n[footfalls.phases]\nfront_left = 0.475\nfront_right = 0.975\n\
                rear_left = 0.225\nrear_right = 0.725";
    assert_eq!(phases(walk).unwrap().stance, with(WALK, "").unwrap().stance);
    // One foot never swings, another for half the cycle, which ends at its phase.
    let uneven = phases(&format!("{walk}\n[footfalls.duties]\nfront_left = 1.0\nrear_left = 0.5"));
    let uneven = uneven.unwrap();
    let row = |j: usize| uneven.stance.iter().map(|flags| flags[j]).collect::<Vec<_>>();
    assert!(row(0).iter().all(|&stands| stands));
    // Swing over phases −0.275 to 0.225, of 32 samples: strictly inside are 24..=31 and 0..=7.
    assert_eq!(row(2), (0..32).map(|i| (8..=23).contains(&i)).collect::<Vec<_>>());
    let fault = |text: &str| {
        let error = phases(text).unwrap_err();
        let found: Vec<_> = error.faults().map(|f| format!("{} | {}", f.message, f.help)).collect();
        assert_eq!(found.len(), 1, "{error}");
        found[0].clone()
    };
    assert!(
        fault(&walk.replace("0.475", "1.5"))
            .contains("`front_left` is 1.5 | give a fraction of the cycle from 0 to 1")
    );
    assert!(fault(&walk.replace("rear_left", "rear_lft")).contains("did you mean `rear_left`"));
    assert!(fault(&walk.replace("rear_left = 0.225\n", "")).contains("`rear_left` is missing"));
    assert!(fault(&walk.replace("duty = 0.8", "gait = \"trot\"")).contains("together with `gait`"));
    assert!(fault(&walk.replace("duty = 0.8\n", "")).contains("`duty`"));
}

#[test]
fn the_slalom_goes_round_both_poles() {
    let motion = with(SLALOM, "").unwrap();
    let plan = plan(&motion);
    let spline = PlanSpline::new(&plan);
    let left = |at_s: f64| spline.sample(at_s).com_m[1];
    // The played motion passes through both times, because they are samples; tolerance is a fifth of the level of 1 mm.
    assert!((left(0.4) - 0.06).abs() < 2e-4 && (left(1.2) + 0.06).abs() < 2e-4);
    assert!(Report::new(&plan).judgement == Judgement::Consistent);
}

#[test]
fn the_duck_stays_under_the_bar_as_it_is_played() {
    let plan = plan(&with(DUCK, "").unwrap());
    let spline = PlanSpline::new(&plan);
    let height = |at_s: f64| spline.sample(at_s).base_position_m[2];
    let under = (0..=600).map(|i| height(0.9 + 0.001 * f64::from(i))).fold(0.0, f64::max);
    assert!(under < 0.24 + 2e-4, "{under}");
    assert!((height(2.4) - 0.294).abs() < 2e-4 && height(0.0) > 0.27);
    assert!(Report::new(&plan).judgement == Judgement::Consistent);
}

#[test]
fn targets_between_samples_hold_in_the_motion_as_played() {
    let tables = "[[target]]\nof = \"com\"\nat_s = 1.93\nleft_m = 0.03\nspeed_forward_m_s = 0.3\n\
                  [[target]]\nof = \"body\"\nat_s = 2.61\nheading_rad = 0.1\n\
                  [[target]]\nof = \"rear_left\"\nat_s = 2.26\nforward_m = 0.4";
    let finer = DRIVE.replace("samples = 25", "samples = 49");
    let plan = plan(&with(&finer, tables).unwrap());
    let spline = PlanSpline::new(&plan);
    let at = |at_s: f64| spline.sample(at_s);
    // The error of the parabola is h³/16 and h²/6 times the third derivative, and that of the spline is similar. The bound is
    // twice that, from the third differences of the plan around the time.
    let third = |at_s: f64, of: fn(&Sample) -> f64| {
        let near = |s: &&Sample| (s.time_s - at_s).abs() < 3.0 * plan.sample_interval_s;
        let values: Vec<f64> = plan.samples.iter().filter(near).map(of).collect();
        let difference = |w: &[f64]| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs();
        values.windows(4).map(difference).fold(0.0, f64::max)
    };
    let within = |off: f64, bound: f64, least: f64| {
        assert!(bound < least, "the bound says nothing: {bound}");
        // Plans converge to a fifth of the level.
        assert!(off.abs() < bound + 2e-4, "{off}");
    };
    within(at(1.93).com_m[1] - 0.03, third(1.93, |s| s.com_m[1]) / 8.0, 1e-3);
    let speed = (at(1.931).com_m[0] - at(1.929).com_m[0]) / 0.002;
    within(speed - 0.3, third(1.93, |s| s.com_m[0]) / plan.sample_interval_s / 3.0, 0.02);
    let yaw = |s: &Sample| s.base_yaw_pitch_roll_rad[0];
    within(yaw(&at(2.61)) - 0.1, third(2.61, yaw) / 8.0, 0.01);
    // The contact point of a wheel on the ground.
    let rear_left = |s: &Sample| s.end_effectors[2].position_m[0];
    within(rear_left(&at(2.26)) - 0.4, third(2.26, rear_left) / 8.0, 1e-3);
}

#[test]
fn a_foot_rises_to_the_height_of_its_target_and_the_others_do_not() {
    let tables = "[[target]]\nof = \"front_left\"\nat_s = 0.62\nup_m = 0.06";
    let plan = plan(&with(WALK, tables).unwrap());
    let height = |j: usize| {
        let heights = plan.samples.iter().map(|s| s.end_effectors[j].position_m[2]);
        heights.fold(0.0, f64::max)
    };
    let played = PlanSpline::new(&plan).sample(0.62).end_effectors[0].position_m[2];
    // Between samples: h³/16 times the third derivative of the arch, 0.03·(2π/0.4)³ m/s³, is 0.9 mm.
    assert!((played - 0.06).abs() < 1e-3, "{played}");
    // The arch is above 0.95 of its top there.
    assert!((0.0600..0.0630).contains(&height(0)), "{}", height(0));
    assert!((height(1) - 0.03).abs() < 1e-3, "{}", height(1));
}

#[test]
fn goals_may_leave_the_distance_free_and_turn_by_more_than_half_a_turn() {
    let edited = |text: &str, edits: &[(&str, &str)]| {
        let replace = |text: String, (from, to): &(&str, &str)| {
            assert!(text.contains(from), "{from}");
            text.replace(from, to)
        };
        with(&edits.iter().fold(text.to_owned(), replace), "").unwrap()
    };
    // 20 degrees per cycle, at any position.
    let free = [
        ("forward_m = 0.12\n", ""),
        ("left_m = 0.0\n", ""),
        ("turn_rad = 0.0", "turn_rad = 0.349"),
    ];
    let turning = plan(&edited(WALK, &free));
    assert!((turning.end_placement.yaw_rad - 0.349).abs() < 2e-4);
    let far = [
        ("duration_s = 2.4", "duration_s = 12.0"),
        ("samples = 16", "samples = 80"),
        ("turn_rad = 0.8", "turn_rad = 4.0"),
    ];
    assert!((plan(&edited(TURN, &far)).end_placement.yaw_rad - 4.0).abs() < 2e-4);
    let aside = plan(&edited(
        WALK,
        &[("forward_m = 0.12", "forward_m = 0.0"), ("left_m = 0.0", "left_m = 0.08")],
    ));
    let [first, after] = [&aside.samples[0], &aside.after].map(|s| s.com_m);
    assert!((after[1] - first[1] - 0.08).abs() < 2e-4 && (after[0] - first[0]).abs() < 2e-4);
}
