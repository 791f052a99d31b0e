//! Runs tests of protocol and firmware in Miri, which detects undefined behaviour and emulates a big-endian machine.
//!
//! Both crates forbid unsafe code, so undefined behaviour can only come from their dependencies. Miri is a hundred times slower
//! than a processor. Random tests therefore draw once, exhaustive tests sample (`cfg(miri)`), and tests that simulate minutes
//! of a robot are left out. Miri is isolated from the machine, so every run is the same.

use crate::{parallel, shell, toolchain};
use std::time::Instant;

/// Target triple of a big-endian machine; our formats are little-endian on every machine.
const BIG_ENDIAN: &str = "s390x-unknown-linux-gnu";

/// Call of `cargo miri test`.
struct Run {
    name: &'static str,
    /// Arguments of `cargo miri test`.
    cargo: &'static [&'static str],
    /// Substrings in the names of the tests to run; empty for all tests.
    only: &'static [&'static str],
    /// Substrings in the names of tests that take minutes in Miri.
    skip: &'static [&'static str],
}

const RUNS: [Run; 5] = [
    // Formats that must not depend on the machine.
    Run {
        name: "golden bytes, big-endian",
        cargo: &["-p", "rollwalk-protocol", "--test", "protocol", "--target", BIG_ENDIAN],
        only: &["golden"],
        skip: &[],
    },
    Run {
        name: "firmware",
        // On x86, libm computes square roots in assembly, which Miri does not support.
        cargo: &["-p", "rollwalk-firmware", "--lib", "--target", BIG_ENDIAN],
        only: &[],
        skip: &[
            // Hundreds of thousands of set-points or periods.
            "as_many_periods_as",
            "nothing_gets_past_the_limits",
            "nothing_that_is_asked_for",
            // Complete lives of stores. Of the library's power cuts, some are sampled.
            "store::tests::behaviour",
            "store::tests::parameters",
            "store::tests::random_flash",
            "store::ram_flash",
            "words_of_1_byte",
            "words_of_8",
            "words_of_16",
            "words_of_32",
            "large_units",
            "a_second_cut",
            "planted_bugs",
            "cuts_while_booting",
        ],
    },
    Run {
        name: "protocol's formats",
        cargo: &["-p", "rollwalk-protocol", "--test", "protocol"],
        only: &[
            "actuator_golden",
            "actuators_all",
            "actuators_cybergear",
            "actuators_maestro",
            "config",
            "isotp",
            "library_golden",
            "library_hostile",
            "transport_golden",
            "wire_golden",
        ],
        // Every set-point of many robots.
        skip: &["traffic_is_the_worst_case"],
    },
    Run { name: "protocol", cargo: &["-p", "rollwalk-protocol", "--lib"], only: &[], skip: &[] },
    // From power-on through arming to the interruption: every part of the controller once.
    Run {
        name: "controller",
        cargo: &["-p", "rollwalk-firmware", "--test", "integration"],
        only: &["a_change_of_mind_while_actuators"],
        skip: &[],
    },
];

/// Runs tests in Miri, in parallel on all cores.
///
/// # Errors
/// Returns Miri's messages about the failed runs. If Miri is missing, the error contains the command that installs it.
pub fn check() -> Result<(), String> {
    toolchain::need_nightly(&["miri", "rust-src"])?;
    shell::run(&mut toolchain::nightly_cargo(&["miri", "setup"]))?;
    shell::run(&mut toolchain::nightly_cargo(&["miri", "setup", "--target", BIG_ENDIAN]))?;
    let failures = parallel::each(&RUNS, run_tests);
    if failures.is_empty() { Ok(()) } else { Err(failures.join("\n\n")) }
}

/// Runs the tests and prints the number of passed tests.
fn run_tests(run: &Run) -> Result<(), String> {
    let start = Instant::now();
    let mut miri = toolchain::nightly_cargo(&["miri", "test"]);
    miri.args(run.cargo).arg("--target-dir").arg(shell::target_folder().join("miri"));
    miri.arg("--").args(run.only).args(run.skip.iter().flat_map(|test| ["--skip", test]));
    // proptest looks for a file of previous failures, which may be missing.
    miri.env("MIRIFLAGS", "-Zmiri-isolation-error=hide -Zmiri-env-forward=PROPTEST_CASES");
    miri.env("PROPTEST_CASES", "1");
    let output = shell::output(&mut miri).map_err(|why| format!("Miri, {}: {why}", run.name))?;
    let passed: usize = output.lines().filter_map(passed).sum();
    if passed == 0 {
        return Err(format!("Miri, {}: no test was run:\n{output}", run.name));
    }
    eprintln!("{}: {passed} tests in {:.0} s", run.name, start.elapsed().as_secs_f64());
    Ok(())
}

/// Number of passed tests in `test result: ok. 12 passed; 0 failed; ...`.
fn passed(line: &str) -> Option<usize> {
    let rest = line.strip_prefix("test result: ok. ")?;
    rest.split_once(" passed")?.0.parse().ok()
}

#[cfg(test)]
mod tests {
    #[test]
    fn passed_tests_are_counted() {
        let line = "test result: ok. 12 passed; 0 failed; 0 ignored; 0 measured; 3 filtered out";
        assert_eq!(super::passed(line), Some(12));
        assert_eq!(super::passed("test link::hello ... ok"), None);
        assert_eq!(super::passed("test result: FAILED. 11 passed; 1 failed;"), None);
    }
}
