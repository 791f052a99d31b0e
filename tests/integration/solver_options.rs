//! Tests of the options of `rollwalk plan` that select the starting point and the method.

use crate::desk_with_shipped_files;
use rollwalk_tests::Desk;
use serde_json::Value;

/// Plans a motion and returns the output of `--json`; asserts that the exit code matches the status.
#[track_caller]
fn plan(desk: &Desk, motion: &str, output: &str, options: &[&str]) -> Value {
    let outcome = desk.run(&[&["plan", motion, "-o", output, "--json"][..], options].concat());
    let told: Value = serde_json::from_str(&outcome.stdout)
        .unwrap_or_else(|error| panic!("{error} in {}\n{}", outcome.stdout, outcome.stderr));
    let simulation = &told["simulation"];
    let holds = simulation.is_null() || simulation["verdict"] == "holds";
    let code = if told["consistent"] == true && holds { 0 } else { 3 };
    assert_eq!(outcome.code, code, "{told}");
    told
}

#[test]
fn a_seed_gives_the_same_plan_again_and_another_seed_converges_too() {
    let desk = desk_with_shipped_files();
    let motion = "motions/drive_1m.toml";
    for name in ["a.json", "b.json"] {
        let told = plan(&desk, motion, name, &["--seed", "3"]);
        assert_eq!((&told["status"], &told["start"]["seed"]), (&"converged".into(), &3.into()));
    }
    assert_eq!(desk.read("a.json"), desk.read("b.json"));
    let told = plan(&desk, motion, "c.json", &["--seed", "4"]);
    assert_eq!(told["status"], "converged");
    assert_ne!(desk.read("a.json"), desk.read("c.json"), "seeds are different starts");
}

#[test]
fn a_chosen_start_is_the_one_taken() {
    let desk = desk_with_shipped_files();
    for start in ["standing", "sinusoid", "warm"] {
        let told = plan(&desk, "motions/walk.toml", "plan.json", &["--start", start]);
        assert_eq!(told["status"], "converged", "{told}");
        assert_eq!(told["start"]["kind"], start);
        let written: Value = serde_json::from_slice(&desk.read("plan.json")).unwrap();
        assert_eq!(written["solve"]["start"], told["start"], "the plan remembers its start");
    }
}

#[test]
fn a_plan_from_a_neighbour_takes_fewer_iterations() {
    let desk = desk_with_shipped_files();
    plan(&desk, "motions/drive_1m.toml", "metre.json", &[]);
    desk.edit("motions/drive_1m.toml", "forward_m = 1.0", "forward_m = 1.02");
    let cold = plan(&desk, "motions/drive_1m.toml", "cold.json", &[]);
    let near = plan(&desk, "motions/drive_1m.toml", "near.json", &["--from", "metre.json"]);
    assert_eq!((&cold["status"], &near["status"]), (&"converged".into(), &"converged".into()));
    assert_eq!(near["start"]["kind"], "neighbour");
    let iterations = |told: &Value| told["iterations"].as_u64().unwrap();
    assert!(iterations(&near) < iterations(&cold), "{near}\n{cold}");

    // A neighbour may have other samples and another duration.
    desk.edit("motions/drive_1m.toml", "samples = 25", "samples = 31");
    desk.edit("motions/drive_1m.toml", "duration_s = 4.0", "duration_s = 4.5");
    let finer = plan(&desk, "motions/drive_1m.toml", "finer.json", &["--from", "metre.json"]);
    assert_eq!(finer["status"], "converged", "{finer}");
}

#[test]
fn a_plan_that_cannot_be_the_start_is_refused() {
    let desk = desk_with_shipped_files();
    plan(&desk, "motions/stand.toml", "stand.json", &[]);
    for (motion, from, words) in [
        ("motions/skate.toml", "stand.json", &["`stand`", "`agilebot`", "`skaterbot`"][..]),
        ("motions/walk.toml", "stand.json", &["`stand`", "\"at_rest\"", "`walk`", "\"periodic\""]),
        ("motions/stand.toml", "robots/agilebot.toml", &["is a robot file, not a plan"]),
        ("motions/stand.toml", "stnad.json", &["no plan", "stnad.json", "stand.json"]),
    ] {
        desk.run(&["plan", motion, "-o", "x.json", "--from", from]).fails(1, words);
        assert!(!desk.path("x.json").exists());
    }
}

#[test]
fn options_that_exclude_each_other_are_refused() {
    let desk = desk_with_shipped_files();
    let motion = ["plan", "motions/stand.toml", "-o", "x.json"];
    for (options, words) in [
        (
            &["--from", "p.json", "--seed", "1"][..],
            &["--from", "--seed", "cannot be used with"][..],
        ),
        (&["--from", "p.json", "--start", "warm"], &["--from", "--start", "cannot be used with"]),
        (&["--start", "sitting"], &["sitting", "standing"]),
        (&["--method", "bfgs"], &["bfgs", "lbfgs"]),
        (&["--seed", "-1"], &["-1"]),
    ] {
        let outcome = desk.run(&[&motion[..], options].concat());
        outcome.fails(2, words);
        assert!(!desk.path("x.json").exists());
    }
}

#[test]
fn the_methods_of_the_thesis_stand_up_too() {
    let desk = desk_with_shipped_files();
    let energy = |told: &Value| told["energy"].as_f64().unwrap();
    let told: Vec<Value> = ["newton-filtered", "newton-true"]
        .iter()
        .map(|method| plan(&desk, "motions/stand.toml", "plan.json", &["--method", method]))
        .collect();
    assert!(told.iter().all(|told| told["status"] == "converged"), "{told:?}");
    // Both minimise the same penalty energy.
    let [filtered, exact] = [energy(&told[0]), energy(&told[1])];
    assert!((filtered - exact).abs() < 1e-6 * exact, "{filtered} and {exact}");
}

#[test]
fn a_method_that_runs_out_of_iterations_says_so() {
    let desk = desk_with_shipped_files();
    let args = ["plan", "motions/drive_1m.toml", "-o", "plan.json", "--start", "standing"];
    let outcome = desk.run(&[&args[..], &["--method", "lbfgs"]].concat());
    assert_eq!(outcome.code, 3, "{}", outcome.stdout);
    for words in ["iteration limit reached after 300 iterations", "did not converge"] {
        assert!(outcome.stdout.contains(words), "{words} in\n{}", outcome.stdout);
    }
    // The plan is written for inspection, and its report agrees.
    assert_eq!(desk.run(&["report", "plan.json"]).code, 3);
}
