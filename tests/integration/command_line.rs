//! Tests of all subcommands: help, completions, exit codes, closed pipes.

use crate::{desk, desk_with_shipped_files};
use rollwalk_tests::program::{PLANNED, Program};
use std::process::Stdio;

#[test]
fn help_teaches_by_example_and_documents_exit_codes() {
    let desk = desk();
    let help = desk.run(&["--help"]).succeeds();
    for words in ["rollwalk demo", "Exit codes:", "130"] {
        assert!(help.contains(words), "{words} in\n{help}");
    }
    for command in [
        &["demo"][..],
        &["plan"],
        &["report"],
        &["export"],
        &["simulate"],
        &["plot"],
        &["robot", "check"],
        &["library", "build"],
        &["library", "inspect"],
        &["console"],
    ] {
        let help = desk.run(&[command, &["--help"]].concat()).succeeds();
        assert!(help.contains("Examples:"), "{command:?} has no examples:\n{help}");
        assert!(help.contains("Exit codes:"), "{command:?} has no exit codes:\n{help}");
    }
}

#[test]
fn the_console_needs_a_terminal_and_says_what_does_not() {
    let outcome = desk().run(&["console", "--bus", "sim"]);
    assert_eq!(outcome.code, 1, "{}", outcome.stderr);
    for words in ["requires a terminal", "rollwalk monitor", "rollwalk send"] {
        assert!(outcome.stderr.contains(words), "{words} in {}", outcome.stderr);
    }
}

#[test]
fn a_wrong_command_line_exits_with_2() {
    let desk = desk();
    for args in [&["paln"][..], &["plan"], &["demo", "--frob"], &["export", "x.json", "--rate"]] {
        let outcome = desk.run(args);
        assert_eq!(outcome.code, 2, "{args:?}: {}", outcome.stderr);
        assert!(outcome.stderr.contains("error:"), "{}", outcome.stderr);
    }
}

#[test]
fn completions_name_the_subcommands() {
    for shell in ["bash", "zsh", "fish"] {
        let script = desk().run(&["completions", shell]).succeeds();
        assert!(script.contains("library") && script.contains("rollwalk"), "{shell}:\n{script}");
    }
}

#[test]
fn doctor_looks_at_this_computer_without_a_bus() {
    let desk = desk();
    let outcome = desk.run(&["doctor", "--system", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&outcome.stdout).unwrap();
    let findings = report["findings"].as_array().unwrap();
    assert!(!findings.is_empty());
    let is_wrong = findings.iter().any(|finding| finding["gravity"] == "wrong");
    assert_eq!(outcome.code, if is_wrong { 5 } else { 0 }, "{findings:#?}");
}

#[test]
fn a_closed_pipe_is_no_error() {
    let desk = desk();
    let mut command = desk.command(&["completions", "bash"]);
    let (reader, writer) = std::io::pipe().unwrap();
    let program = Program::start(command.stdout(writer).stderr(Stdio::piped()));
    drop(reader);
    let outcome = program.ends();
    assert_eq!((outcome.code, outcome.stderr.as_str()), (0, ""));
}

#[test]
fn nobody_has_to_listen_to_what_is_said_on_the_side() {
    let desk = desk_with_shipped_files();
    for (args, code) in [
        (&["plan", "motions/none.toml", "-o", "plan.json"][..], 1),
        (&["plan", "motions/stand.toml", "-o", "plan.json", "-v"], 0),
    ] {
        // The reading end is gone before the command starts.
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let program = Program::start(desk.command(args).stdout(Stdio::null()).stderr(writer));
        assert_eq!(program.ends_within(PLANNED).code, code, "{args:?}");
    }
}
