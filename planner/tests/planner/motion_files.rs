//! Motion and library files: contents of shipped files, and faults of broken ones with their lines.

use proptest::prelude::*;
use rollwalk_multibody::ground::Terrain;
use rollwalk_multibody::ground::file::from_toml;
use rollwalk_planner::library_file::LibraryFile;
use rollwalk_planner::motion::{Ends, Motion, Reserve};
use rollwalk_robot::Robot;
use rollwalk_robot::document::DocumentError;

fn agilebot() -> Robot {
    let text = include_str!("../../../shipped/robots/agilebot.toml");
    Robot::from_toml("robots/agilebot.toml", text).unwrap()
}

fn creature3() -> Robot {
    let text = include_str!("../../../shipped/robots/creature3.toml");
    Robot::from_toml("robots/creature3.toml", text).unwrap()
}

const STAND: &str = include_str!("../../../shipped/motions/stand.toml");
const DRIVE: &str = include_str!("../../../shipped/motions/drive_1m.toml");
const TURN: &str = include_str!("../../../shipped/motions/turn_in_place.toml");
const WALK: &str = include_str!("../../../shipped/motions/walk.toml");
const LIBRARY: &str = include_str!("../../../shipped/motions/agilebot_library.toml");

fn motion(text: &str) -> Motion {
    Motion::from_toml("m.toml", text, &agilebot()).unwrap()
}

/// Pattern of `#` and `.` of one end effector, as in a motion file.
fn row(motion: &Motion, foot: usize) -> String {
    motion.stance.iter().map(|flags| if flags[foot] { '#' } else { '.' }).collect()
}

/// Asserts that `text` has exactly the given faults, as `line: message | help` fragments.
fn assert_faults<T>(result: Result<T, DocumentError>, expected: &[(usize, &str, &str)]) {
    let error = result.err().expect("the text is broken");
    let found: Vec<_> =
        error.faults().map(|f| (f.line, f.message.clone(), f.help.clone())).collect();
    assert_eq!(found.len(), expected.len(), "{found:#?}");
    for ((line, message, help), (want_line, want_message, want_help)) in found.iter().zip(expected)
    {
        assert_eq!(line, want_line, "{message} ({help})");
        assert!(message.contains(want_message), "{message:?} lacks {want_message:?}");
        assert!(help.contains(want_help), "{help:?} lacks {want_help:?}");
    }
}

fn broken(from: &str, to: &str) -> Result<Motion, DocumentError> {
    assert!(WALK.contains(from), "the file to break has changed: {from}");
    Motion::from_toml("walk.toml", &WALK.replacen(from, to, 1), &agilebot())
}

/// Number of the line of the shipped walk file that begins with `start`.
fn line(start: &str) -> usize {
    1 + WALK.lines().position(|line| line.starts_with(start)).unwrap()
}

#[test]
fn shipped_motions_are_valid_and_name_the_robot() {
    for text in [STAND, DRIVE, TURN, WALK, LIBRARY] {
        assert_eq!(Motion::robot_path_in_toml("m.toml", text).unwrap(), "../robots/agilebot.toml");
    }
    let drive = motion(DRIVE);
    assert_eq!(
        (drive.name.as_str(), drive.ends, drive.stance.len()),
        ("drive_1m", Ends::AtRest, 25)
    );
    assert_eq!(drive.goal.forward_m, Some(1.0));
    let turn = motion(TURN);
    assert_eq!(
        (turn.ends, turn.goal.forward_m, turn.goal.turn_rad),
        (Ends::Periodic, Some(0.0), Some(0.8))
    );
    let stand = motion(STAND);
    assert!(stand.stance.iter().flatten().all(|&stance| stance));
}

#[test]
fn the_mean_speed_of_the_drive_leaves_room_to_start_and_stop() {
    let (drive, robot) = (motion(DRIVE), agilebot());
    let wheel = &robot.end_effectors[0];
    let top = wheel.radius_m * wheel.contact.actuator().unwrap().speed_max_rad_s;
    let mean = drive.goal.forward_m.unwrap() / drive.duration_s;
    // A trapezoid that accelerates and brakes in a fifth of the time each has a peak of 1.25 × mean.
    assert!(1.25 * mean < top, "mean {mean} m/s, top {top} m/s");
}

#[test]
fn walking_has_three_feet_down_and_the_rows_of_its_comment() {
    let walk = motion(WALK);
    for flags in &walk.stance {
        assert!(flags.iter().filter(|&&stance| stance).count() >= 3);
    }
    let robot = agilebot();
    for (index, foot) in robot.end_effectors.iter().enumerate() {
        let comment = WALK.lines().find(|line| line.starts_with(&format!("#   {} ", foot.name)));
        let pattern = comment.unwrap().split('"').nth(1).unwrap();
        assert_eq!(row(&walk, index), pattern, "{}", foot.name);
        assert_eq!(row(&walk, index).matches('.').count(), 7, "{}", foot.name);
    }
}

#[test]
fn rows_may_be_written_by_hand_and_are_stretched_to_the_samples() {
    let rows = "front_left = \"#### ....\"\nfront_right = \"....|####\"\n\
                rear_left = \"....####\"\nrear_right = \"####....\"";
    let walk = broken("gait = \"walk\"\nduty = 0.8", rows).unwrap();
    assert_eq!(row(&walk, 0), "################................");
    assert_eq!(row(&walk, 1), "................################");
    let trot = broken("gait = \"walk\"\nduty = 0.8", "gait = \"trot\"\nduty = 0.5").unwrap();
    assert_eq!(row(&trot, 0), row(&trot, 3));
    assert_eq!(row(&trot, 1), row(&trot, 2));
    // Swings are open intervals of phase, so 15 of 32 samples are strictly inside half a cycle.
    assert_eq!(row(&trot, 0).matches('.').count(), 15);
}

#[test]
fn a_posture_takes_the_place_of_nominal_angles() {
    let robot = agilebot();
    let turn = motion(TURN);
    let steer = robot.joints.iter().position(|joint| joint.name == "rear_left_steer").unwrap();
    assert_eq!(turn.posture_rad[steer], 0.89);
    assert_eq!(turn.posture_rad[0], robot.joints[0].nominal_rad);
    let with = |line: &str| broken("[footfalls]", &format!("[posture]\n{line}\n[footfalls]"));
    let at = line("[footfalls]") + 1; // below its header, which stands where the footfalls' stood
    assert_faults(
        with("rear_left_ster = 0.5"),
        &[(at, "the robot has no joint `rear_left_ster`", "rear_left_steer")],
    );
    assert_faults(
        with("rear_left_steer = 50.0"),
        &[(at, "posture: `rear_left_steer` is 50 rad", "give an angle from -1.6 to 1.6 rad")],
    );
}

#[test]
fn durations_are_whole_frames_and_may_be_rounded_to_four_decimals() {
    let exact = broken("duration_s = 1.6", "duration_s = 1.2667").unwrap();
    assert_eq!(exact.duration_s, 76.0 / 60.0);
    let at = line("duration_s");
    assert_faults(
        broken("duration_s = 1.6", "duration_s = 1.59"),
        &[(at, "motion `walk`: `duration_s` is 1.59 s", "1.5833 or 1.6000")],
    );
    assert_faults(broken("duration_s = 1.6", "duration_s = 96"), &[(at, "is 96", "0.1 to 60 s")]);
}

#[test]
fn samples_follow_from_the_duration_when_not_given() {
    let stand = STAND.replace("samples = 12\n", "");
    assert_eq!(motion(&stand).stance.len(), 24);
    let long = stand.replace("duration_s = 1.0", "duration_s = 4.0");
    assert_eq!(motion(&long).stance.len(), 60); // 15 a second
}

#[test]
fn a_motion_may_leave_more_or_less_in_reserve() {
    let told = "swing_height_m = 0.03\ntorque_use = 0.6\nspeed_use = 0.9";
    let Reserve { torque_use, speed_use } = broken("swing_height_m = 0.03", told).unwrap().reserve;
    assert_eq!((torque_use, speed_use), (0.6, 0.9));
    assert_eq!(broken("", "").unwrap().reserve, Reserve { torque_use: 0.8, speed_use: 1.0 });
    assert_faults(
        broken("swing_height_m = 0.03", "swing_height_m = 0.03\ntorque_use = 1.2\nspeed_use = 0"),
        &[
            (line("swing_height_m") + 1, "`torque_use` is 1.2", "0.1 to 1"),
            (line("swing_height_m") + 2, "`speed_use` is 0", "0.1 to 1"),
        ],
    );
}

#[test]
fn a_motion_may_say_why_it_needs_feedback() {
    let reason = "it balances on two feet";
    let told = format!("swing_height_m = 0.03\nneeds_feedback = \"{reason}\"");
    let motion = broken("swing_height_m = 0.03", &told).unwrap();
    assert_eq!(motion.needs_feedback.as_deref(), Some(reason));
    assert_eq!(broken("", "").unwrap().needs_feedback, None);
}

#[test]
fn every_kind_of_mistake_in_a_motion_file_is_named() {
    let footfalls = line("[footfalls]");
    let gait = line("gait");
    let hand = |rows: &str| broken("gait = \"walk\"\nduty = 0.8", rows);

    assert_faults(
        broken("swing_height_m = 0.03", "swing_height_m = 0.03\nneeds_feedback = \" \""),
        &[(line("swing_height_m") + 1, "`needs_feedback` is empty", "give the reason")],
    );
    assert_faults(
        broken("ends = \"periodic\"", "ends = periodic"),
        &[(line("ends"), "not TOML", "quotes")],
    );
    assert_faults(
        broken("ends = \"periodic\"", "ends = \"preiodic\""),
        &[(line("ends"), "`ends` cannot be \"preiodic\"", "did you mean `periodic`?")],
    );
    assert_faults(broken("ends = \"periodic\"\n", ""), &[(1, "`ends` is missing", "give `ends`")]);
    assert_faults(
        broken("swing_height_m = 0.03", "swing_hight_m = 0.03"),
        &[
            (
                1,
                "`swing_height_m` is missing or 0 while feet swing",
                "such as swing_height_m = 0.03",
            ),
            (line("swing"), "unknown key `swing_hight_m`", "did you mean `swing_height_m`?"),
        ],
    );
    assert_faults(
        broken("turn_rad = 0.0", "turn_rad = 20"),
        &[(line("turn_rad"), "`turn_rad` is 20 rad", "0.3491 rad")],
    );
    assert_faults(
        broken("forward_m = 0.12", "forward_mm = 120"),
        &[(line("forward_m"), "[goal]: unknown key `forward_mm`", "give `forward_m = 0.12`")],
    );
    assert_faults(
        broken("samples = 32", "samples = 2.5"),
        &[(line("samples"), "must be a whole number from 4 to 480", "4 to 480")],
    );
    assert_faults(
        broken("samples = 32", "samples = 8"),
        &[(footfalls, "a swing of 1 of 8 samples", "`samples` to 24 or more")],
    );
    assert_faults(
        broken("duty = 0.8", "duty = 80"),
        &[(gait + 1, "`duty` is 80", "give a value from 0.3 to 0.95")],
    );
    assert_faults(
        broken("gait = \"walk\"", "gait = \"wlak\""),
        &[(gait, "`gait` cannot be \"wlak\"", "did you mean `walk`?")],
    );
    assert_faults(
        hand("all = \"swing\""),
        &[(gait, "`all` cannot be \"swing\"", "valid names: `stance`")],
    );
    assert_faults(
        hand("front_left = \"##..##\"\nfront_right = \"######\"\nrear_left = \"######\""),
        &[(footfalls, "`rear_right` is missing", "one row of # (stance) and . (swing)")],
    );
    assert_faults(
        hand(
            "front_left = \"##..##\"\nfront_right = \"#####\"\nrear_left = \"######\"\nrear_right = \"######\"",
        ),
        &[(
            gait + 1,
            "row `front_right` differs in length",
            "`front_left` has 6 characters, but this row has 5",
        )],
    );
    assert_faults(
        hand(
            "front_left = \"##..##\"\nfront_lift = \"######\"\nrear_left = \"#-####\"\nrear_right = \"\"",
        ),
        &[
            (gait + 1, "robot `agilebot` has no `front_lift`", "did you mean `front_left`?"),
            (gait + 2, "row `rear_left` is not a footfall pattern", "# for stance and . for swing"),
            (gait + 3, "row `rear_right` is not a footfall pattern", "# for stance"),
        ],
    );
    // A swing of 1 of 300 samples has 3 samples only with 900, and a motion has at most 480.
    let brief = format!("{}.", "#".repeat(299));
    let rows = ["front_left", "front_right", "rear_left", "rear_right"];
    let rows = rows.map(|foot| format!("{foot} = \"{brief}\"")).join("\n");
    let text = WALK.replace("gait = \"walk\"\nduty = 0.8", &rows);
    let faults =
        Motion::from_toml("m.toml", &text.replace("samples = 32", "samples = 300"), &agilebot());
    let faults = faults.unwrap_err();
    let advised = |of: &str| faults.faults().any(|fault| fault.help.contains(of));
    assert!(advised("or better to 5, or let the feet swing less often"), "{faults:?}");
    let air = "front_left = \"..\"\nfront_right = \"..\"\nrear_left = \"..\"\nrear_right = \"..\"";
    assert_faults(hand(air), &[(footfalls, "no foot in stance", "with # for stance")]);
    // A leap with all feet in the air for a while is allowed.
    hand(&air.replace("..", "##..##")).unwrap();
    let rest = WALK.replace("periodic", "at_rest").replace("\"walk\"\n", "\"trot\"\n");
    let rest = rest.replace("gait = \"trot\"\nduty = 0.8", &air.replace("..", "..##"));
    assert_faults(
        Motion::from_toml("m.toml", &rest, &agilebot()),
        &[(footfalls, "a foot in the air at the start or end", "begin and end every row with #")],
    );
}

#[test]
fn goals_out_of_reach_are_rejected_before_the_optimiser_tries() {
    // Farther than the wheels roll, by the forward lean of the body: `planner/tests/planner/start.rs` plans it.
    let leaning = DRIVE.replace("forward_m = 1.0", "forward_m = 1.5");
    Motion::from_toml("m.toml", &leaning, &agilebot()).unwrap();
    let short = DRIVE.replace("duration_s = 4.0", "duration_s = 2.5");
    let short = short.replace("forward_m = 1.0", "forward_m = 4.0");
    let duration = 1 + DRIVE.lines().position(|line| line.starts_with("duration_s")).unwrap();
    assert_faults(
        Motion::from_toml("m.toml", &short, &agilebot()),
        &[(
            duration,
            "2.5 s for a distance of 4 m on the wheel of `front_left`",
            "takes at least 11.68 s at",
        )],
    );
    // At 0.25 m/s, 20 m take 80 s.
    let far = short.replace("forward_m = 4.0", "forward_m = 20.0");
    let text = include_str!("../../../shipped/robots/agilebot.toml");
    let slow = text.replace("speed_max_rad_s = 6.85", "speed_max_rad_s = 5.0");
    let slow = Robot::from_toml("slow.toml", &slow).unwrap();
    assert_faults(
        Motion::from_toml("m.toml", &far, &slow),
        &[(duration, "2.5 s for a distance of 20 m", "a motion takes at most 60 s: rolling")],
    );
    let error = Motion::from_toml("m.toml", DRIVE, &creature3()).unwrap_err();
    let first = error.faults().next().unwrap();
    assert!(first.message.contains("`front_left` never leaves the ground"), "{first}");
}

#[test]
fn the_shipped_library_joins_stand_with_all_and_walk_with_turn() {
    let library = LibraryFile::from_toml("l.toml", LIBRARY, &agilebot()).unwrap();
    let names: Vec<_> = library.motions.iter().map(|motion| motion.name.as_str()).collect();
    assert_eq!(names, ["stand", "drive_1m", "turn_in_place", "walk"]);
    assert_eq!(library.safe, 0);
    assert!(library.torques);
    let without = LIBRARY.replacen("safe = ", "torques = false\nsafe = ", 1);
    let without = LibraryFile::from_toml("l.toml", &without, &agilebot()).unwrap();
    assert_eq!(LibraryFile { torques: false, ..library.clone() }, without);
    let mut joined: Vec<_> = library.transitions.iter().map(|t| (t.from, t.to)).collect();
    joined.sort_unstable();
    assert_eq!(joined, [(0, 1), (0, 2), (0, 3), (1, 0), (2, 0), (2, 3), (3, 0), (3, 2)]);
    for transition in &library.transitions {
        assert_eq!(transition.motion.ends, Ends::Prescribed);
        assert_eq!(transition.motion.stance.len(), 25);
    }
    let motions = [STAND, DRIVE, TURN, WALK].map(motion);
    library.check_motions("l.toml", LIBRARY, &motions).unwrap();
    for (listed, text) in library.motions.iter().zip([STAND, DRIVE, TURN, WALK]) {
        assert_eq!(motion(text).name, listed.name);
    }
}

#[test]
fn every_kind_of_mistake_in_a_library_file_is_named() {
    let robot = agilebot();
    let break_it = |from: &str, to: &str| {
        assert!(LIBRARY.contains(from), "the file to break has changed: {from}");
        LibraryFile::from_toml("l.toml", &LIBRARY.replacen(from, to, 1), &robot)
    };
    let line = |start: &str| 1 + LIBRARY.lines().position(|line| line == start).unwrap();
    assert_faults(
        break_it("safe = \"stand\"", "safe = \"stnad\""),
        &[(
            line("safe = \"stand\""),
            "names \"stnad\", which is not a motion",
            "did you mean `stand`?",
        )],
    );
    let empty = "name = \"empty\"\nrobot = \"agilebot.toml\"\nsafe = \"stand\"\n";
    assert_faults(
        LibraryFile::from_toml("l.toml", empty, &robot),
        &[
            (1, "`motion` has 0 tables", "write 1 to 32 [[motion]] tables"),
            (3, "names \"stand\", which is not a motion", "add a [[motion]]"),
        ],
    );
    assert_faults(
        break_it("code = 4", "code = 2"),
        &[(line("code = 4"), "code 2 already selects `drive_1m`", "its own code, 1 to 255")],
    );
    assert_faults(
        break_it("code = 4", "code = 0"),
        &[(line("code = 4"), "must be a whole number from 1 to 255", "1 to 255")],
    );
    assert_faults(
        break_it("from = \"walk\"", "from = \"turn_in_place\""),
        &[(
            line("from = \"walk\"") + 1,
            "`to` names the same motion as `from`",
            "ends = \"periodic\"",
        )],
    );
    assert_faults(
        break_it(
            "from = \"turn_in_place\"\nto = \"walk\"",
            "from = \"walk\"\nto = \"turn_in_place\"",
        ),
        &[(
            line("from = \"turn_in_place\""),
            "that an earlier [[transition]] joins",
            "for each direction",
        )],
    );
    for (name, words) in [
        ("w\u{430}lk", "letters of several scripts"),
        ("wa\u{308}lk", "a letter and its accent as two characters"),
    ] {
        let faults = break_it("name = \"walk\"", &format!("name = \"{name}\""));
        assert_faults(faults, &[(line("name = \"walk\""), words, "letters of one script")]);
    }
    assert_faults(
        break_it("name = \"walk\"", "name = \"stand\""),
        &[
            (line("name = \"walk\""), "`stand` is listed twice", "its own name"),
            (line("from = \"walk\""), "names \"walk\", which is not a motion", "valid names"),
            (line("to = \"walk\""), "names \"walk\", which is not a motion", "valid names"),
        ],
    );
    assert_faults(
        break_it("[via_safe]\nduration_s = 1.2\nsamples = 25\n", ""),
        &[
            (
                line("[[motion]]") + 5,
                "`drive_1m` cannot be reached from the safe motion `stand`",
                "to = \"drive_1m\"",
            ),
            (line("[[motion]]") + 10, "`turn_in_place` cannot be reached", "[via_safe]"),
            (line("[[motion]]") + 15, "`walk` cannot be reached", "[via_safe]"),
        ],
    );
    assert_faults(
        break_it("duration_s = 1.2", "duration_s = 1.21"),
        &[(line("[via_safe]") + 1, "is 1.21 s", "1.2000 or 1.2167")],
    );
}

#[test]
fn a_library_is_checked_against_its_motions() {
    let robot = agilebot();
    let library = LibraryFile::from_toml("l.toml", LIBRARY, &robot).unwrap();
    let mut motions = [STAND, DRIVE, TURN, WALK].map(motion);
    motions[0].ends = Ends::Periodic;
    let line = |start: &str| 1 + LIBRARY.lines().position(|line| line == start).unwrap();
    let safe = line("safe = \"stand\"");
    assert_faults(
        library.check_motions("l.toml", LIBRARY, &motions),
        &[(safe, "does not stand still", "at_rest")],
    );
    motions[0].ends = Ends::AtRest;
    motions[3].stance[0][2] = false;
    let via = line("[via_safe]");
    assert_faults(
        library.check_motions("l.toml", LIBRARY, &motions),
        &[
            (via, "`stand to walk` enters `walk` with other feet in stance", "correct the first"),
            (line("[[transition]]"), "`walk to turn_in_place`", "correct the first"),
            (line("[[transition]]") + 6, "`turn_in_place to walk`", "correct the first"),
        ],
    );
}

proptest! {
    /// Checks that reading returns a value or faults inside the text, whatever bytes a file contains.
    #[test]
    fn damaged_files_never_panic(
        file in prop::sample::select(vec![STAND, DRIVE, TURN, WALK, LIBRARY]),
        at in 0.0..1.0,
        cut in 0..40usize,
        put in "[ -~\n#.é]{0,12}",
    ) {
        let at = (at * file.len() as f64) as usize;
        let end = (at + cut).min(file.len());
        let text = format!("{}{put}{}", &file[..at], &file[end..]);
        let robot = agilebot();
        let errors = [
            Motion::from_toml("m.toml", &text, &robot).err(),
            LibraryFile::from_toml("l.toml", &text, &robot).err(),
        ];
        for fault in errors.iter().flatten().flat_map(DocumentError::faults) {
            prop_assert!(fault.span.end <= text.len());
        }
    }
}

#[test]
fn wheels_are_driven_unless_a_motion_holds_them() {
    let held = |line: &str| broken("samples = 32\n", &format!("samples = 32\n{line}\n"));
    assert_eq!(motion(WALK).held_wheels, [false; 4]);
    assert_eq!(held("wheels = \"actuated\"").unwrap().held_wheels, [false; 4]);
    assert_eq!(held("wheels = \"held\"").unwrap().held_wheels, [true; 4]);
    let one = held("wheels = [\"front_right\"]").unwrap();
    assert_eq!(one.held_wheels, [false, true, false, false]);
    let at = line("samples") + 1;
    assert_faults(held("wheels = \"locked\""), &[(at, "cannot be \"locked\"", "held")]);
    assert_faults(
        held("wheels = [\"front_rihgt\"]"),
        &[(at, "no actuated wheel `front_rihgt`", "front_right")],
    );
    assert_faults(held("wheels = 1"), &[(at, "must be a string", "a string in quotes")]);
    let none = Motion::from_toml(
        "m.toml",
        &STAND.replacen("ends =", "wheels = \"held\"\nends =", 1),
        &creature3(),
    );
    assert!(none.unwrap_err().faults().any(|f| f.message.contains("has no wheel with a motor")));
}

#[test]
fn held_wheels_that_never_swing_reach_as_far_as_their_links_pitch() {
    let still = |goal: &str, ends: &str| {
        let text = DRIVE
            .replacen("ends = \"at_rest\"", &format!("ends = \"{ends}\"\nwheels = \"held\""), 1)
            .replacen("forward_m = 1.0", goal, 1);
        Motion::from_toml("m.toml", &text, &agilebot())
    };
    // Wheels of 0.05 m roll π · 0.05 m = 0.157 m within half a turn.
    assert!(still("forward_m = 0.1", "at_rest").is_ok());
    for (goal, ends) in [("forward_m = 0.2", "at_rest"), ("forward_m = 0.1", "periodic")] {
        let error = still(goal, ends).unwrap_err();
        assert!(error.faults().count() > 0);
        assert!(error.faults().all(|f| f.message.contains("cannot be reached")), "{error}");
    }
}

/// Walk at rest at its ends, with several cycles.
fn cycles(count: u32) -> String {
    WALK.replacen("ends = \"periodic\"", "ends = \"at_rest\"", 1)
        .replacen("duration_s = 1.6", "duration_s = 4.0", 1)
        .replacen("samples = 32", "samples = 81", 1)
        .replacen("duty = 0.8", &format!("duty = 0.8\ncycles = {count}"), 1)
}

#[test]
fn cycles_repeat_a_gait_between_two_stands_with_whole_swings() {
    let walk = motion(&cycles(2));
    // Two cycles and half a cycle of standing in 80 intervals: 32 a cycle, 8 at each end.
    for foot in 0..4 {
        let row = row(&walk, foot);
        assert!(row.starts_with("########") && row.ends_with("########"), "{row}");
        let swings: Vec<_> = row.split('#').filter(|swing| !swing.is_empty()).collect();
        assert_eq!(swings.len(), 2, "{row}");
        assert!(swings.iter().all(|swing| swing.len() >= 6), "{row}");
    }
    let periodic = broken("duty = 0.8", "duty = 0.8\ncycles = 2").unwrap_err();
    let named = |fault: &str| fault.contains("`cycles` is for motions at rest");
    assert!(
        periodic.faults().any(|fault| named(&fault.message) && fault.help.contains("one cycle"))
    );
}

#[test]
fn a_terrain_must_be_read_and_needs_ends_at_rest() {
    let robot = agilebot();
    let climb = cycles(2).replacen("swing_height_m", "terrain = \"step.toml\"\nswing_height_m", 1);
    assert_eq!(
        Motion::terrain_path_in_toml("climb.toml", &climb).unwrap().as_deref(),
        Some("step.toml")
    );
    assert_eq!(Motion::terrain_path_in_toml("walk.toml", WALK).unwrap(), None);
    let refused = |text: &str, terrain: Option<&Terrain>| {
        let error = Motion::from_toml_on("climb.toml", text, &robot, terrain).unwrap_err();
        error.faults().map(|fault| format!("{}; {}", fault.message, fault.help)).collect::<String>()
    };
    let unread = refused(&climb, None);
    assert!(unread.contains("`terrain` is \"step.toml\", which was not read"), "{unread}");

    let step = from_toml("step.toml", "[step]\nat_x_m = 0.4\nheight_m = 0.03").unwrap();
    let read = Motion::from_toml_on("climb.toml", &climb, &robot, Some(&step)).unwrap();
    assert_eq!(read.ground.terrain(), Some(&step));
    // Defaults scale with the robot.
    let margins = read.terrain.unwrap().margins;
    assert!(margins.margin_m > 0.01 && margins.swing_reach_m > margins.margin_m, "{margins:?}");
    let periodic = WALK.replacen("swing_height_m", "terrain = \"step.toml\"\nswing_height_m", 1);
    let periodic = refused(&periodic, Some(&step));
    assert!(periodic.contains("terrain does not repeat"), "{periodic}");
    let alone = format!("{}\n[contact]\nmargin_m = 0.02\n", cycles(2));
    let alone = refused(&alone, None);
    assert!(alone.contains("`contact` is for motions on terrain"), "{alone}");
    let far = format!("{climb}\n[contact]\nmargin_m = 2\n");
    let far = refused(&far, Some(&step));
    assert!(far.contains("`margin_m` is 2") && far.contains("0.001 to 1 m"), "{far}");
}

#[test]
fn a_gait_moves_all_end_effectors_of_a_limb() {
    let mut robot = agilebot();
    let wheels = std::mem::take(&mut robot.end_effectors);
    for part in ["toe", "heel"] {
        let of_limb = wheels.iter().cloned().map(|mut wheel| {
            wheel.name = format!("{}_{part}", wheel.name);
            wheel
        });
        robot.end_effectors.extend(of_limb);
    }
    let trot = WALK.replacen("gait = \"walk\"", "gait = \"trot\"", 1);
    let on_eight = Motion::from_toml("m.toml", &trot, &robot).unwrap();
    let on_four = motion(&trot);
    for foot in 0..4 {
        assert_eq!(row(&on_eight, foot), row(&on_four, foot));
        assert_eq!(row(&on_eight, foot + 4), row(&on_four, foot));
    }
    // A name with the same beginning is another foot.
    robot.end_effectors[0].name = "front_leftmost".into();
    assert!(Motion::from_toml("m.toml", &trot, &robot).is_err());
}

#[test]
fn times_are_given_unless_the_file_frees_them() {
    use rollwalk_planner::motion::{FreeTimes, Timing};
    let timed = |keys: &str| broken("ends = ", &format!("{keys}\nends = "));
    let given = motion(WALK).timing;
    assert_eq!((given, given.free), (Timing::default(), FreeTimes::Given));
    assert_eq!(timed("timing = \"given\"").unwrap(), motion(WALK));
    let free = timed("timing = \"free\"\ntiming_bounds = [0.5, 2]").unwrap().timing;
    assert_eq!(free, Timing { free: FreeTimes::Free, bounds: [0.5, 2.0] });
    assert_eq!(timed("timing = \"duration\"").unwrap().timing.bounds, [0.7, 1.4]);

    let at = line("ends");
    assert_faults(timed("timing = \"fre\""), &[(at, "cannot be \"fre\"", "free")]);
    assert_faults(
        timed("timing_bounds = [0.7, 1.4]"),
        &[(at, "`timing_bounds` bounds times that are given", "timing = \"duration\"")],
    );
    for bounds in ["[1.1, 1.4]", "[0.7, 0.9]", "[0.1, 1.4]", "[0.7, 5.0]"] {
        assert_faults(
            timed(&format!("timing = \"free\"\ntiming_bounds = {bounds}")),
            &[(at + 1, "`timing_bounds` is [", "such as [0.7, 1.4]")],
        );
    }
    let target = "[[target]]\nof = \"com\"\nat_s = 0.8\nleft_m = 0.01\n[footfalls]";
    let text = WALK.replace("[footfalls]", target).replace("ends =", "timing = \"free\"\nends =");
    assert_faults(
        Motion::from_toml("walk.toml", &text, &agilebot()),
        &[(at, "`timing` is given together with `[[target]]`", "names times in seconds")],
    );
    // A limit over the whole motion has no time of its own.
    let whole = "[[height]]\nof = \"body\"\nbelow_m = 0.5\n[footfalls]";
    let text = WALK.replace("[footfalls]", whole).replace("ends =", "timing = \"free\"\nends =");
    assert!(Motion::from_toml("walk.toml", &text, &agilebot()).is_ok());
}
