//! Workspaces of the repository, and their lock files.

use crate::shell;

/// Manifests of all workspaces, each of which has its own `Cargo.lock`.
pub const WORKSPACES: [&str; 6] = [
    "Cargo.toml",
    "firmware/boards/mps2-an386/Cargo.toml",
    "firmware/boards/nucleo-g474re/Cargo.toml",
    "firmware/boards/pico2/Cargo.toml",
    "tests/fuzz/Cargo.toml",
    "apps/packaging/rollwalk_ros2/Cargo.toml",
];

/// Checks that each lock file follows the manifests. A dependency that a crate gains or loses changes the locks of all workspaces
/// that use the crate; the test command builds some of these workspaces only when their folders have changed. Cargo downloads
/// the dependencies of all workspaces for the check.
///
/// # Errors
/// Returns an error that names the outdated lock files, with the commands that update them.
pub fn check() -> Result<(), String> {
    let outdated = |manifest: &&str| {
        let metadata = ["metadata", "--locked", "--format-version", "1", "--manifest-path"];
        shell::output(shell::cargo(&metadata).arg(manifest)).err()
    };
    let failures: Vec<String> = WORKSPACES
        .iter()
        .filter_map(|manifest| {
            let why = outdated(manifest)?;
            let remedy = if why.contains("lock file") {
                format!("\n    cargo update --workspace --manifest-path {manifest}")
            } else {
                String::new()
            };
            Some(format!("{manifest}: {why}{remedy}"))
        })
        .collect();
    if failures.is_empty() { Ok(()) } else { Err(failures.join("\n")) }
}
