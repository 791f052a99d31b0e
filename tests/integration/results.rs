//! Tests of the results of valid input on the command line: plans, reports, tables, plots and libraries.

use crate::desk_with_shipped_files;
use rollwalk_tests::program::{PLANNED, Program, within};
use serde_json::Value;
use std::process::Stdio;

pub fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error} in\n{text}"))
}

#[test]
fn a_robot_as_json_is_the_robot_in_its_plans() {
    let desk = desk_with_shipped_files();
    let robot = json(&desk.run(&["robot", "check", "robots/agilebot.toml", "--json"]).succeeds());
    assert_eq!(robot["robot"]["joints"].as_array().unwrap().len(), 16);
    desk.run(&["plan", "motions/drive_1m.toml", "-o", "plan.json"]).succeeds();
    assert_eq!(json(&desk.read_text("plan.json"))["robot"], robot["robot"]);
}

#[test]
fn a_plan_reaches_its_goal_and_its_report_says_so() {
    let desk = desk_with_shipped_files();
    let args = ["plan", "motions/drive_1m.toml", "-o", "plan.json", "--json"];
    let outcome = json(&desk.run(&args).succeeds());
    assert_eq!(outcome["status"], "converged");
    assert_eq!(outcome["plan"], "plan.json");

    let report = json(&desk.run(&["report", "plan.json", "--json"]).succeeds());
    assert_eq!((&report["consistent"], &report["judgement"]), (&true.into(), &"consistent".into()));
    assert_eq!(outcome["simulation"]["verdict"], "holds", "{outcome}");
    let rows = report["rows"].as_array().unwrap();
    let row = |name: &str| {
        let at_samples = |row: &&Value| row["name"] == name && row["grid"] == "samples";
        rows.iter().find(at_samples).unwrap_or_else(|| panic!("no row {name}"))
    };
    for name in
        ["linear dynamics", "angular dynamics", "slip", "contact point", "displacement goal"]
    {
        let row = row(name);
        // A converged plan must be within a fifth of every tolerance.
        assert!(row["worst"].as_f64() <= row["level"].as_f64().map(|level| 0.2 * level), "{row}");
    }

    // The same goal, read from the plan's samples: the centre of mass moves one metre.
    let plan = json(&desk.read_text("plan.json"));
    let x = |sample: &Value| sample["com_m"][0].as_f64().unwrap();
    let samples = plan["samples"].as_array().unwrap();
    let travelled = x(samples.last().unwrap()) - x(&samples[0]);
    assert!((travelled - 1.0).abs() < 1e-3, "goals hold to a millimetre: {travelled}");
}

#[test]
fn a_plan_that_does_not_converge_exits_with_3_and_can_be_looked_at() {
    let desk = desk_with_shipped_files();
    // Eight metres in a cycle: within the file's rules, beyond the robot's legs and wheels.
    desk.edit("motions/walk.toml", "forward_m = 0.12", "forward_m = 8.0");
    let outcome = desk.run(&["plan", "motions/walk.toml", "-o", "plan.json", "--json"]);
    assert_eq!(outcome.code, 3, "{}", outcome.stderr);
    let outcome = json(&outcome.stdout);
    assert_ne!(outcome["status"], "converged");
    assert!(outcome["worst_level"].as_f64() > Some(0.2), "{outcome}");
    let report = desk.run(&["report", "plan.json", "--json"]);
    assert_eq!(report.code, 3, "one verdict for both");
    let report = json(&report.stdout);
    assert_eq!(
        (&report["consistent"], &report["judgement"]),
        (&false.into(), &outcome["judgement"])
    );
    assert!(outcome["simulation"].is_null(), "{outcome}");
}

/// Plans a motion and reports on it; asserts that exit code, judgement and text of both agree.
#[track_caller]
fn agreed(desk: &rollwalk_tests::Desk, plan: &[&str]) -> (i32, Value) {
    let planned = desk.run(&[&["plan", "-o", "plan.json", "--no-simulation"], plan].concat());
    let report = desk.run(&["report", "plan.json"]);
    assert_eq!(planned.code, report.code, "{}\n{}", planned.stdout, report.stdout);
    let conclusion = planned.stdout.lines().nth(2).expect("a verdict");
    assert!(report.stdout.contains(conclusion), "{conclusion} in\n{}", report.stdout);
    let told = json(&desk.run(&["report", "plan.json", "--json"]).stdout);
    assert_eq!(told["consistent"], planned.code == 0);
    (planned.code, told)
}

#[test]
fn plan_and_report_have_one_verdict() {
    let desk = desk_with_shipped_files();
    let judged = |plan: &[&str]| {
        let (code, told) = agreed(&desk, plan);
        (code, told["judgement"].as_str().unwrap_or_default().to_owned())
    };
    let ends = |code: i32, word: &str| (code, word.to_owned());
    assert_eq!(judged(&["motions/drive_1m.toml"]), ends(0, "consistent"));
    let few = ["motions/walk.toml", "--start", "standing", "--iterations", "1"];
    assert_eq!(judged(&few), ends(3, "not_converged"));
    // A walk that needs feedback according to its file.
    assert_eq!(judged(&["motions/table_2_1/creature3_fast_walk.toml"]), ends(0, "needs_feedback"));
    // With twelve samples, six strokes of a skate leave the ground and slip between samples.
    desk.edit("motions/table_2_1/dinobot_skating.toml", "samples = 24", "samples = 12");
    let skating = "motions/table_2_1/dinobot_skating.toml";
    assert_eq!(judged(&[skating, "--samples-fixed"]), ends(3, "fails_as_played"));

    // With more samples, the same plan is consistent, and the report gives the reason for more samples.
    let (code, told) = agreed(&desk, &[skating]);
    assert_eq!((code, &told["judgement"]), (0, &"consistent".into()));
    let coarser = &told["solve"]["refinements"][0];
    assert_eq!(coarser["samples"], 12);
    assert!(coarser["worst"].as_f64() > coarser["tolerance"].as_f64(), "{coarser}");
    let told = desk.run(&["report", "plan.json"]).stdout;
    assert!(told.contains("with 12 samples, "), "{told}");

    // A plan that was changed after its solve converged.
    let mut plan = json(&desk.read_text("plan.json"));
    plan["samples"][3]["com_m"][1] = 0.5.into();
    desk.write("plan.json", plan.to_string());
    let report = desk.run(&["report", "plan.json"]);
    assert_eq!(report.code, 3, "{}", report.stdout);
    assert!(report.stdout.contains("the plan was changed"), "{}", report.stdout);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn a_library_with_a_plan_that_does_not_converge_is_not_written_and_says_which() {
    let desk = desk_with_shipped_files();
    desk.edit("motions/walk.toml", "forward_m = 0.12", "forward_m = 8.0");
    let file = "motions/agilebot_library.toml";
    // Messages and file names use the name in the library, not the name in the motion's own file.
    for name in ["name = \"walk\"", "from = \"walk\"", "to = \"walk\""] {
        desk.edit(file, name, &name.replace("walk", "stride"));
    }
    let outcome = desk.run(&["library", "build", file, "-o", "a.rwl"]);
    assert_eq!(outcome.code, 3, "{}", outcome.stderr);
    for words in ["stride did not converge", "tolerance", "nothing written"] {
        assert!(outcome.stdout.contains(words), "{words} in\n{}", outcome.stdout);
    }
    let left_out = "left out: stride did not converge";
    assert_eq!(outcome.stderr.matches(left_out).count(), 4, "{}", outcome.stderr);
    assert!(!desk.path("a.rwl").exists());

    let outcome = desk.run(&["demo", "--library", file, "--out", "out"]);
    assert_eq!(outcome.code, 3, "{}", outcome.stderr);
    assert!(outcome.stderr.contains("nothing flashed"), "{}", outcome.stderr);
    assert!(desk.path("out/plans/stride.json").exists() && !desk.path("out/bus.log").exists());
}

#[test]
fn tables_have_a_row_for_every_tick_and_a_unit_in_every_column() {
    let desk = desk_with_shipped_files();
    desk.make(&["plan", "motions/drive_1m.toml", "-o", "plan.json"]);
    desk.run(&["export", "plan.json", "--rate", "60", "-o", "plan.csv"]).succeeds();
    let csv = desk.read_text("plan.csv");
    let mut lines = csv.lines();
    let columns: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!(columns[0], "time_s");
    // Four seconds at 60 Hz, both ends included.
    assert_eq!(lines.clone().count(), 4 * 60 + 1);
    assert!(lines.all(|line| line.split(',').count() == columns.len()));

    desk.run(&["export", "plan.json", "--format", "json", "-o", "table.json"]).succeeds();
    let table = json(&desk.read_text("table.json"));
    assert_eq!(table["columns"].as_array().unwrap().len(), columns.len());
    assert_eq!(table["rows"].as_array().unwrap().len(), 4 * 60 + 1);
}

#[test]
fn a_plot_is_an_svg_document() {
    let desk = desk_with_shipped_files();
    desk.make(&["plan", "motions/walk.toml", "-o", "plan.json"]);
    desk.run(&["plot", "plan.json", "-o", "walk.svg"]).succeeds();
    let svg = desk.read_text("walk.svg");
    assert!(svg.trim_start().starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    for label in ["front_left", "walk"] {
        assert!(svg.contains(label), "the plot names {label}");
    }
    desk.run(&["plot", "--strip", "plan.json", "plan.json", "-o", "strip.svg"]).succeeds();
    assert!(desk.read_text("strip.svg").trim_end().ends_with("</svg>"));
    desk.run(&["plot", "plan.json", "plan.json", "-o", "two.svg"])
        .fails(1, &["2 plans do not fit", "--strip"]);
    let args = ["plot", "--animate", "--forces", "--footfalls", "plan.json", "-o", "moving.svg"];
    desk.run(&args).succeeds();
    let moving = desk.read_text("moving.svg");
    assert!(moving.trim_end().ends_with("</svg>") && moving.contains("animation-delay"));
    desk.run(&["plot", "--forces", "plan.json", "-o", "no.svg"]).fails(2, &["--animate"]);
}

#[test]
fn a_library_holds_what_its_file_asks_for() {
    let desk = desk_with_shipped_files();
    let args = ["library", "build", "motions/agilebot_library.toml", "-o", "a.rwl", "--json"];
    let built = json(&desk.run(&args).succeeds());
    let bytes = desk.read("a.rwl").len();
    assert_eq!(built["bytes"], bytes);

    let content = json(&desk.run(&["library", "inspect", "a.rwl", "--json"]).succeeds());
    assert_eq!(content["bytes"], bytes);
    assert_eq!(content["robot"], "agilebot");
    assert_eq!(content["safe"], "stand");
    let codes: Vec<_> = content["motions"].as_array().unwrap().iter().map(|m| &m["code"]).collect();
    assert_eq!(codes, [1, 2, 3, 4]);
    let transitions = content["transitions"].as_array().unwrap();
    // Three motions to and from SAFE, and walk to turn and back.
    assert_eq!(transitions.len(), 8);
}

#[test]
fn the_same_input_gives_the_same_library() {
    let desk = desk_with_shipped_files();
    for name in ["first.rwl", "second.rwl"] {
        let args = ["library", "build", "motions/agilebot_library.toml", "-o", name];
        desk.run(&args).succeeds();
    }
    assert_eq!(desk.read("first.rwl"), desk.read("second.rwl"));
}

#[test]
fn an_interrupted_solve_writes_nothing_and_exits_with_130() {
    // Solves take a tenth of a second here; this solve is interrupted before its first iteration.
    let desk = desk_with_shipped_files();
    desk.edit("motions/turn_in_place.toml", "samples = 16", "samples = 400");
    let mut command =
        desk.command(&["plan", "motions/turn_in_place.toml", "-o", "plan.json", "-v"]);
    let program = Program::start(command.stdout(Stdio::piped()).stderr(Stdio::piped()));
    // The first iterations are printed after the handler is installed.
    within("three iterations", || (program.wait_for_words("").lines().count() >= 3).then_some(()));
    program.signal("INT");
    let outcome = program.ends_within(PLANNED);
    assert_eq!(outcome.code, 130, "{}", outcome.stderr);
    assert!(!desk.path("plan.json").exists());
}

/// Tests a robot on two wheels, which is balanced as planned, but tips.
#[test]
fn a_consistent_plan_whose_robot_tips_does_not_hold_in_simulation() {
    let desk = desk_with_shipped_files();
    let car = desk.read_text("robots/car.toml");
    let (front, _) = car.split_once("[[end_effector]]\nname = \"rear_left\"").expect("rear wheels");
    let on_two = front.replace("center_in_link_m = [0.12,", "center_in_link_m = [0.002,");
    desk.write("robots/car.toml", on_two);
    desk.edit("motions/car_drive.toml", "forward_m = 0.5", "forward_m = 0.0");
    let plan = ["plan", "motions/car_drive.toml", "-o", "plan.json"];
    let words = ["consistent: no residual exceeds its tolerance", "fails in simulation: "];
    desk.run(&plan).succeeds_with(3, &words);
    let told = desk.run(&[&plan[..], &["--json"]].concat());
    let told = json(&told.stdout);
    assert_eq!(told["consistent"], true, "{told}");
    assert_eq!(told["simulation"]["verdict"], "fails", "{told}");
    desk.run(&[&plan[..], &["--no-simulation"]].concat()).succeeds_with(0, &["consistent: "]);
    desk.run(&["simulate", "plan.json"]).succeeds_with(3, &["fails in simulation: "]);
}

#[test]
fn a_glide_that_goes_too_far_on_a_coarse_grid_is_planned_on_a_finer_one() {
    let desk = desk_with_shipped_files();
    let glide = "name = \"glide\"\nrobot = \"robots/swizzlebot.toml\"\nends = \"periodic\"\nduration_s = 1.883333\n\
                 [footfalls]\nall = \"stance\"\n[goal]\nforward_m = 0.0851\nturn_rad = 0.0\n";
    desk.write("glide.toml", glide);
    let plan = ["plan", "glide.toml", "-o", "plan.json"];
    let fixed = desk.run(&[&plan[..], &["--samples-fixed"]].concat());
    fixed.succeeds_with(3, &["fails in simulation: the robot covers 1.0"]);
    let finer = desk.run(&plan);
    assert_eq!(finer.code, 0, "{}", finer.stderr);
    assert!(
        finer.stdout.contains(", 56 samples") && finer.stdout.contains("passes the simulation")
    );
    let told =
        ["with 28 samples the motion fails in simulation", "give samples = 56 in the motion file"];
    assert!(told.iter().all(|told| finer.stderr.contains(told)), "{}", finer.stderr);
    desk.run(&["simulate", "plan.json", "--cycles", "8"]).succeeds();
}

#[test]
fn a_goal_that_only_posture_meets_is_refused_and_a_lean_is_not() {
    let desk = desk_with_shipped_files();
    let lean = |goal: &str| {
        format!(
            "name = \"lean\"\nrobot = \"robots/agilebot.toml\"\nends = \"at_rest\"\nduration_s = 1.0\n\
             [footfalls]\nall = \"stance\"\n{goal}"
        )
    };
    desk.write("lean.toml", lean("[goal]\nforward_m = 0.0\nleft_m = 0.0\nturn_rad = 0.1\n"));
    // The wheels steer: the robot may rotate over fixed contacts, or drive.
    let turned = desk.run(&["plan", "lean.toml", "-o", "plan.json", "--json"]);
    let told = json(&turned.stdout);
    let report = json(&desk.run(&["report", "plan.json", "--json"]).stdout);
    let left = report["taken_back"]["left"].as_f64().expect("a goal at rest");
    assert_eq!(told["judgement"] == "taken_back", left < 0.05, "{report}");
    assert_eq!(turned.code, if left < 0.05 { 3 } else { 0 });
    desk.write("lean.toml", lean("[[target]]\nof = \"com\"\nat_s = 0.5\nleft_m = 0.03\n"));
    desk.run(&["plan", "lean.toml", "-o", "plan.json"])
        .succeeds_with(0, &["passes the simulation"]);
}
