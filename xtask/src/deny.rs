//! Checks of the crates that we use: advisories, licences, duplicates and sources, by the rules of `deny.toml`.

use crate::{shell, toolchain};

const CARGO_DENY: (&str, &str) = ("cargo-deny", "0.20.2");

/// Manifests of all workspaces: each has a `Cargo.lock` of its own.
const WORKSPACES: [&str; 6] = [
    "Cargo.toml",
    "firmware/boards/mps2-an386/Cargo.toml",
    "firmware/boards/nucleo-g474re/Cargo.toml",
    "firmware/boards/pico2/Cargo.toml",
    "tests/fuzz/Cargo.toml",
    "apps/packaging/rollwalk_ros2/Cargo.toml",
];

/// Checks the crates of all workspaces. Without a network by the advisories of an earlier run; cargo-deny refuses those when
/// they are older than three months.
///
/// # Errors
/// The workspaces with findings, which are on the terminal; or the command that installs cargo-deny.
pub fn check() -> Result<(), String> {
    let deny = toolchain::subcommand(CARGO_DENY)?;
    let fetched = shell::run(&mut shell::command(&deny, &["deny", "fetch", "db"]));
    let mut failures = Vec::new();
    for manifest in WORKSPACES {
        eprintln!("{manifest}");
        // Crates for other machines too, whose licences are asked for.
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
        // One list is for all workspaces, and none of them has all that is on it.
        for unused in
            ["unmatched-skip", "license-not-encountered", "license-exception-not-encountered"]
        {
            check.args(["--allow", unused]);
        }
        failures.extend(shell::run(&mut check).err());
    }
    if let (false, Err(why)) = (failures.is_empty(), fetched) {
        failures.push(format!("perhaps for want of new advisories: {why}"));
    }
    if failures.is_empty() { Ok(()) } else { Err(failures.join("\n")) }
}
