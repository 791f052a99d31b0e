//! Runs tests of protocol and firmware in Miri: no undefined behaviour in what they use, and every
//! check of a debug build; the firmware and golden bytes as on a big-endian machine.
//!
//! Both crates forbid unsafe code, so what Miri can find is in their dependencies, as they use them.
//! It is a hundred times slower than a processor: random tests draw once, exhaustive ones take samples
//! (`cfg(miri)`), and what simulates minutes of a robot stays out. Isolated from the machine, it does
//! the same every time.

use crate::{nightly, parallel, shell};
use std::time::Instant;

/// What we send and store is little-endian on every machine; this one is not.
const BIG_ENDIAN: &str = "s390x-unknown-linux-gnu";

/// What is run.
struct Run {
    name: &'static str,
    /// Arguments of `cargo miri test`.
    cargo: &'static [&'static str],
    /// Tests to run, or all.
    only: &'static [&'static str],
    /// Tests that take minutes in Miri.
    skip: &'static [&'static str],
}

const RUNS: [Run; 5] = [
    Run {
        name: "firmware",
        // On x86, libm takes its square roots in assembly, which Miri does not know.
        cargo: &["-p", "rollwalk-firmware", "--lib", "--target", BIG_ENDIAN],
        only: &[],
        skip: &[
            // Hundreds of thousands of setpoints, or of periods.
            "as_many_periods_as",
            "nothing_gets_past_the_limits",
            "nothing_that_is_asked_for",
            // Whole lives of stores; of the library's power cuts some are sampled.
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
        // Every setpoint of many robots.
        skip: &["traffic_is_the_worst_case"],
    },
    Run { name: "protocol", cargo: &["-p", "rollwalk-protocol", "--lib"], only: &[], skip: &[] },
    // From power-on through arming and its interruption: what there is of the controller, once.
    Run {
        name: "controller",
        cargo: &["-p", "rollwalk-firmware", "--test", "integration"],
        only: &["a_change_of_mind_while_actuators"],
        skip: &[],
    },
    Run {
        name: "golden bytes, big-endian",
        cargo: &["-p", "rollwalk-protocol", "--test", "protocol", "--target", BIG_ENDIAN],
        only: &["golden"],
        skip: &[],
    },
];

/// Runs them, as many at a time as there are cores.
///
/// # Errors
/// What Miri said of those that fail; or the command that installs Miri.
pub fn check() -> Result<(), String> {
    nightly::need(&["miri", "rust-src"])?;
    for target in [&[][..], &["--target", BIG_ENDIAN]] {
        shell::run(nightly::cargo(&["miri", "setup"]).args(target))?;
    }
    let failures = parallel::each(&RUNS, run);
    if failures.is_empty() { Ok(()) } else { Err(failures.join("\n\n")) }
}

/// One of them; says how many tests passed.
fn run(run: &Run) -> Result<(), String> {
    let start = Instant::now();
    let mut miri = nightly::cargo(&["miri", "test"]);
    miri.args(run.cargo).arg("--target-dir").arg(shell::target_folder().join("miri"));
    miri.arg("--").args(run.only).args(run.skip.iter().flat_map(|test| ["--skip", test]));
    // A file of former failures is looked for, and may be missing.
    miri.env("MIRIFLAGS", "-Zmiri-isolation-error=hide -Zmiri-env-forward=PROPTEST_CASES");
    miri.env("PROPTEST_CASES", "1");
    let said = shell::output(&mut miri).map_err(|why| format!("Miri, {}: {why}", run.name))?;
    let passed: usize = said.lines().filter_map(passed).sum();
    if passed == 0 {
        return Err(format!("Miri, {}: no test was run:\n{said}", run.name));
    }
    eprintln!("{}: {passed} tests in {:.0} s", run.name, start.elapsed().as_secs_f64());
    Ok(())
}

/// From `test result: ok. 12 passed; 0 failed; ...`.
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
