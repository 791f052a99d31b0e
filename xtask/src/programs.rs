//! Runs test programs in parallel on all cores, and those with real-time deadlines alone at the end.
//!
//! Cargo runs test programs one after the other; near the end of each, its longest test keeps one core busy and the others
//! idle.

use crate::workspace::Program;
use crate::{parallel, shell};
use std::time::Instant;

/// Name of the end-to-end tests, which run longest and wait most.
const END_TO_END: &str = "integration";
/// Filter for tests whose simulated robots have real-time deadlines. Programs that run in parallel would make them
/// miss the deadlines.
const REAL_TIME: &str = "::in_real_time_";
/// Number of parallel real-time tests. With three of them on two cores, set-point streams arrive late and the tests are
/// repeated.
const REAL_TIME_THREADS: &str = "--test-threads=2";
/// Number of parallel tests of [`END_TO_END`] without deadlines; most of them wait for robots that play in real time.
const END_TO_END_THREADS: &str = "--test-threads=4";

/// Runs test programs in parallel, without the tests that [`in_real_time`] runs.
///
/// # Errors
/// Returns the complete output of the failed programs.
pub fn beside_each_other(programs: &[&Program]) -> Result<(), String> {
    let mut programs = programs.to_vec();
    // The other programs run at the same time.
    programs.sort_by_key(|program| program.name != END_TO_END);
    let failures = parallel::each(&programs, |program| {
        let start = Instant::now();
        let mut tests = program.command(&["--quiet", "--skip", REAL_TIME]);
        if program.name == END_TO_END {
            tests.arg(END_TO_END_THREADS);
        }
        shell::output(&mut tests).map_err(|why| format!("{}: {why}", program.shown()))?;
        eprintln!("{} ok in {:.1} s", program.shown(), start.elapsed().as_secs_f64());
        Ok(())
    });
    if failures.is_empty() { Ok(()) } else { Err(failures.join("\n\n")) }
}

/// Runs modules of the end-to-end tests, without the tests that [`in_real_time`] runs.
///
/// # Errors
/// Returns the command line of the first module with a failed test; the output of its tests is on the terminal.
pub fn modules(programs: &[&Program], modules: &[String]) -> Result<(), String> {
    for program in programs.iter().filter(|program| program.name == END_TO_END) {
        for module in modules {
            let module = format!("{module}::");
            let tests = ["--quiet", "--skip", REAL_TIME, END_TO_END_THREADS, &module];
            shell::run(&mut program.command(&tests))?;
        }
    }
    Ok(())
}

/// Runs the tests with real-time deadlines of all programs, with no other program in parallel.
///
/// # Errors
/// Returns the programs with failed tests, or an error if a program does not list its tests, or if there are no such tests.
pub fn in_real_time(programs: &[&Program]) -> Result<(), String> {
    let tests = programs.iter();
    let tests = tests.map(|program| program.command_if_any(&[REAL_TIME, REAL_TIME_THREADS]));
    let tests = tests.filter_map(Result::transpose).collect::<Result<Vec<_>, _>>()?;
    let outcomes: Vec<_> = tests.into_iter().map(|mut tests| shell::run(&mut tests)).collect();
    if outcomes.is_empty() {
        return Err(format!("no program has tests for `{REAL_TIME}`"));
    }
    let failures: Vec<_> = outcomes.into_iter().filter_map(Result::err).collect();
    if failures.is_empty() { Ok(()) } else { Err(failures.join("\n\n")) }
}
