//! Builds of the controller's crates for microcontrollers, without std and alloc.
//!
//! rustup installs a missing target. If rustup cannot download it, the crates are built with Debian's compiler, which includes
//! the sources of `core`.

use crate::debian;
use crate::shell::{self, cargo, command};
use std::path::PathBuf;
use std::process::Command;

/// Target triple of the Cortex-M4F.
pub const CORTEX_M4F: &str = "thumbv7em-none-eabihf";
/// Target triple of the Cortex-M33 with FPU.
pub const CORTEX_M33F: &str = "thumbv8m.main-none-eabihf";
const CRATES: [&str; 4] = ["-p", "rollwalk-protocol", "-p", "rollwalk-firmware"];
const KEYS: [&str; 2] = ["--features", "rollwalk-firmware/authenticated,rollwalk-firmware/ed25519"];
const DEBIAN_PACKAGES: [&str; 4] = ["rustc-web", "cargo-web", "rust-web-src", "lld"];
const DEBIAN_CARGO: &str = "/usr/bin/cargo";
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";

/// Command `cargo build --release` for a target, to be completed by the caller.
pub struct Build {
    pub cargo: Command,
    /// Folder of the built programs.
    pub artefacts: PathBuf,
}

/// Builds the controller's crates with keys for the Cortex-M4F; the emulated board builds them without keys.
///
/// # Errors
/// Returns the compiler's errors, or the command that installs a missing toolchain.
pub fn check() -> Result<(), String> {
    shell::run(build(CORTEX_M4F)?.cargo.args(CRATES).args(KEYS))
}

/// Prepares a build with rustup's toolchain, or with Debian's if rustup's lacks the target.
///
/// # Errors
/// Returns the command that installs a toolchain if none has the target.
pub fn build(target: &str) -> Result<Build, String> {
    let rustup = rustup_has(target);
    // Two folders, because artefacts of the two compilers must not mix.
    let folder = shell::target_folder().join(if rustup { "bare-metal" } else { "debian" });
    let artefacts = folder.join(target).join("release");
    let args = ["build", "--release", "--target", target];
    if rustup {
        let mut cargo = cargo(&args);
        cargo.arg("--target-dir").arg(folder);
        return Ok(Build { cargo, artefacts });
    }
    eprintln!("rustup cannot install {target}; using Debian's compiler instead");
    debian::need(&DEBIAN_PACKAGES).map_err(|install| {
        format!(
            "there is no compiler for {target}. Run one of these commands, then try \
             again:\n\n    rustup target add {target}\n    {install}"
        )
    })?;
    let mut cargo = command(DEBIAN_CARGO, &args);
    // RUSTC_BOOTSTRAP lets a stable compiler build `core`. Debian's compiler may be older than the workspace's minimum, which
    // these crates do not need.
    cargo.args(["-Z", "build-std=core", "--ignore-rust-version", "--target-dir"]).arg(folder);
    cargo.env("RUSTC_BOOTSTRAP", "1").env("RUSTC", DEBIAN_RUSTC);
    let variable = target.to_uppercase().replace(['-', '.'], "_");
    cargo.env(format!("CARGO_TARGET_{variable}_LINKER"), "ld.lld");
    without_rustup(&mut cargo);
    Ok(Build { cargo, artefacts })
}

/// True if the current toolchain has the `core` of a target, after an installation by rustup if necessary.
fn rustup_has(target: &str) -> bool {
    let installed = || {
        shell::output(&mut command("rustup", &["target", "list", "--installed"]))
            .is_ok_and(|list| list.lines().any(|line| line.trim() == target))
    };
    installed()
        || (shell::run(&mut command("rustup", &["target", "add", target])).is_ok() && installed())
}

/// Installs a target of the current toolchain by rustup if it is missing.
///
/// # Errors
/// Returns the command that installs the target if this machine cannot.
pub fn need_target(target: &str) -> Result<(), String> {
    match rustup_has(target) {
        true => Ok(()),
        false => Err(format!(
            "the target {target} is missing. Install the target \
            with:\n\n    rustup target add {target}"
        )),
    }
}

/// Removes the environment variables by which rustup's cargo selects its own toolchain.
fn without_rustup(command: &mut Command) {
    for name in ["CARGO", "RUSTUP_TOOLCHAIN", "RUSTUP_HOME", "RUSTC_WRAPPER", "RUSTDOC"] {
        command.env_remove(name);
    }
}
