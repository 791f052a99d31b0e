//! Checks of the dependencies: advisories, licences, duplicates and sources, by the rules of `deny.toml`.

use crate::locks::WORKSPACES;
use crate::{shell, toolchain};

const CARGO_DENY: (&str, &str) = ("cargo-deny", "0.20.2");

/// Checks the dependencies of all workspaces. Without a network the advisories of an earlier run are used; cargo-deny refuses
/// them when they are older than three months.
///
/// # Errors
/// Returns the workspaces with findings, which are printed on the terminal. If cargo-deny is missing, the error contains the
/// command that installs it.
pub fn check() -> Result<(), String> {
    let deny = toolchain::subcommand(CARGO_DENY)?;
    let fetched = shell::run(&mut shell::command(&deny, &["deny", "fetch", "db"]));
    let mut failures = Vec::new();
    for manifest in WORKSPACES {
        eprintln!("{manifest}");
        // Also crates for other machines, whose licences are checked.
        shell::run(&mut shell::cargo(&[
            "fetch",
            "--quiet",
            "--locked",
            "--manifest-path",
            manifest,
        ]))?;
        let mut check = shell::command(&deny, &["deny", "--manifest-path", manifest, "--locked"]);
        check.args(["--all-features"]).args(fetched.is_err().then_some("--offline"));
        check.args(["check", "--hide-inclusion-graph"]);
        // One list serves all workspaces, and none has every entry.
        for unused in
            ["unmatched-skip", "license-not-encountered", "license-exception-not-encountered"]
        {
            check.args(["--allow", unused]);
        }
        failures.extend(shell::run(&mut check).err());
    }
    if let (false, Err(why)) = (failures.is_empty(), fetched) {
        failures.push(format!(
            "the advisories may be outdated, because they could not be fetched: \
            {why}"
        ));
    }
    if failures.is_empty() { Ok(()) } else { Err(failures.join("\n")) }
}
