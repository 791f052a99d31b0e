//! Tests of problem files for bug reports: writing them with `rollwalk plan --dump`, and solving them again.

use crate::{desk, desk_with_shipped_files};
use rollwalk_tests::Desk;
use rollwalk_tests::program::Program;
use serde_json::Value;
use std::process::Stdio;

/// Dumps a problem. Returns a desk that contains only that file, and the plan of the original solve.
#[track_caller]
fn dumped(from: &Desk, options: &[&str], exit: i32) -> (Desk, Vec<u8>) {
    let args = ["plan", "motions/drive_1m.toml", "-o", "plan.json", "--dump", "it.json"];
    let outcome = from.run(&[&args[..], options].concat());
    assert_eq!(outcome.code, exit, "{}", outcome.stderr);
    let other = desk();
    other.write("it.json", from.read("it.json"));
    (other, from.read("plan.json"))
}

#[test]
fn a_problem_gives_the_same_plan_where_nothing_else_is() {
    let desk = desk_with_shipped_files();
    desk.run(&["plan", "motions/drive_1m.toml", "-o", "near.json", "--seed", "2"]).succeeds();
    desk.edit("motions/drive_1m.toml", "forward_m = 1.0", "forward_m = 1.05");
    for (options, exit) in [
        (&[][..], 0),
        (&["--seed", "18446744073709551615", "--start", "sinusoid"], 0),
        (&["--from", "near.json"], 0),
        (&["--method", "lbfgs", "--iterations", "40"], 3),
    ] {
        let (other, plan) = dumped(&desk, options, exit);
        let outcome =
            other.run(&["plan", "it.json", "-o", "again.json", "--dump", "again.problem"]);
        assert_eq!(outcome.code, exit, "{options:?}: {}", outcome.stderr);
        assert!(other.read("again.json") == plan, "{options:?} gives another plan");
        assert!(other.read("again.problem") == other.read("it.json"), "{options:?}");
        let solve = &serde_json::from_slice::<Value>(&plan).unwrap()["solve"];
        assert!(exit == 0 || solve["iterations"] == 40, "the limit is kept: {solve}");
    }
}

#[test]
fn a_problem_is_written_before_the_solve() {
    let desk = desk_with_shipped_files();
    desk.edit("motions/turn_in_place.toml", "samples = 16", "samples = 400");
    let args = ["plan", "motions/turn_in_place.toml", "-o", "plan.json", "-v", "--dump", "it.json"];
    let program = Program::start(desk.command(&args).stderr(Stdio::piped()));
    program.wait_for_words("");
    drop(program);
    assert!(!desk.path("plan.json").exists(), "the solve was killed at its beginning");
    let problem: Value = serde_json::from_slice(&desk.read("it.json")).unwrap();
    let lines = problem["motion"]["lines"].as_array().unwrap();
    assert!(lines.contains(&"samples = 400".into()), "{problem}");
    assert_eq!(problem["robot"]["path"], "robots/agilebot.toml");
}

#[test]
fn a_solve_that_ends_at_its_limit_asks_for_the_problem() {
    let desk = desk_with_shipped_files();
    let args = ["plan", "motions/walk.toml", "-o", "plan.json"];
    let args = [&args[..], &["--start", "standing", "--iterations", "1"]].concat();
    let outcome = desk.run(&args);
    assert_eq!(outcome.code, 3);
    assert!(outcome.stderr.contains("--dump PROBLEM.json"), "{}", outcome.stderr);
    let outcome = desk.run(&[&args[..], &["--dump", "it.json"]].concat());
    assert!(outcome.stderr.contains("report a bug with it.json"), "{}", outcome.stderr);
    // Without a failure there is no request for a report.
    let outcome = desk.run(&args[..4]);
    assert!(outcome.code == 0 && !outcome.stderr.contains("--dump"), "{}", outcome.stderr);
}

#[test]
fn a_bad_problem_names_the_place() {
    let (desk, _) = dumped(&desk_with_shipped_files(), &[], 0);
    let good = desk.read_text("it.json");
    let edit = |from: &str, to: &str| {
        assert!(good.contains(from), "{from} in\n{good}");
        good.replacen(from, to, 1)
    };
    let cases = [
        (edit("rollwalk-problem", "somebody-else"), &["format is \"somebody-else\""][..]),
        (
            edit("\"version\": 1", "\"version\": 7"),
            &["version is 7", "expected 1", "update rollwalk"],
        ),
        (edit("\"version\": 1", "\"version\": \"1\""), &["version is \"1\"", "expected 1"]),
        (
            edit("\"seed\": 0", "\"seed\": -1"),
            &["it.json:", "options.seed is -1; expected a whole number of 0 or more"],
        ),
        (edit("\"seed\"", "\"sed\""), &["options: unknown field `sed`; did you mean `seed`?"]),
        (edit("\"auto\"", "\"nap\""), &["options.start is \"nap\"", "`warm`"]),
        (
            edit("\"iterations\": 300", "\"iterations\": 0"),
            &["options.iterations is 0; expected a whole number above 0"],
        ),
        (edit("\"robot\": {", "\"robo\": {"), &["unknown field `robo`; did you mean `robot`?"]),
        (
            edit("\"lines\": [", "\"lines\": [7, "),
            &["motion.lines[0] is 7; expected text in quotes"],
        ),
        (
            edit("\"lines\": [", &format!("\"lines\": [\"# {}\", ", "x".repeat(1 << 20))),
            &["it.json: motions/drive_1m.toml has", "a motion file (TOML) has at most 1048576"],
        ),
        (
            edit("ends = \\\"at_rest\\\"", "ends = \\\"resting\\\""),
            &["motions/drive_1m.toml:", "resting"],
        ),
        (
            edit("mass_kg = 0.600", "mass_kg = -0.6"),
            &["robots/agilebot.toml:", "`mass_kg` is -0.6"],
        ),
        (
            edit("\"from\": null", "\"from\": {\"path\": \"p.json\", \"lines\": []}"),
            &["p.json:1:0", "JSON"],
        ),
        (good[..good.len() / 2].to_owned(), &["the JSON is incomplete"]),
        (format!("{good}x"), &["this is not JSON", "trailing"]),
        ("[".repeat(5000), &["it.json"]),
        ("{\"format\":".to_owned() + &"[".repeat(100_000), &["this is not JSON", "recursion"]),
    ];
    for (bad, words) in cases {
        assert!(bad != good);
        desk.write("it.json", &bad);
        desk.run(&["plan", "it.json", "-o", "x.json"]).fails(1, words);
        assert!(!desk.path("x.json").exists());
    }
}

#[test]
fn a_problem_keeps_to_its_own_options_and_place() {
    let (desk, _) = dumped(&desk_with_shipped_files(), &[], 0);
    desk.run(&["plan", "it.json", "-o", "x.json", "--seed", "1"])
        .fails(1, &["it.json", "own options", "--seed", "leave out this option"]);
    desk.run(&["plan", "it.json", "-o", "x.json", "--dump", "x.json"])
        .fails(1, &["cannot write x.json and x.json: they are the same file"]);
    desk.run(&["report", "it.json"]).fails(1, &["it.json is a problem file, not a plan"]);
    desk.run(&["robot", "check", "it.json"]).fails(1, &["is a problem file, not a robot file"]);
    // A problem that contains a plan is not a plan, and a plan is not a problem.
    desk.run(&["plan", "it.json", "-o", "plan.json"]).succeeds();
    desk.run(&["plan", "plan.json", "-o", "x.json"]).fails(1, &["is a plan, not a motion file"]);
    assert!(!desk.path("x.json").exists());
    // Another program's problem is solved, with a warning.
    desk.edit("it.json", "\"program\": \"rollwalk ", "\"program\": \"rollwalk 0.0.");
    let outcome = desk.run(&["plan", "it.json", "-o", "y.json"]);
    assert!(outcome.stderr.contains("written by rollwalk 0.0."), "{}", outcome.stderr);
    assert_eq!(desk.read("y.json"), desk.read("plan.json"));
}
