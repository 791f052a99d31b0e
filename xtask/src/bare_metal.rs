//! Builds the controller's crates for the Cortex-M4F, where there is neither std nor alloc.
//!
//! The rustup target is installed when missing. Where rustup cannot download it, Debian's own
//! compiler, which ships with matching sources of `core`, builds the same crates.

use crate::debian;
use crate::shell::{self, cargo, command};
use std::process::Command;

const TARGET: &str = "thumbv7em-none-eabihf";
const CRATES: [&str; 4] = ["-p", "rollwalk-protocol", "-p", "rollwalk-firmware"];
const DEBIAN_PACKAGES: [&str; 4] = ["rustc-web", "cargo-web", "rust-web-src", "lld"];
const DEBIAN_CARGO: &str = "/usr/bin/cargo";
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";

/// Builds with the first toolchain that can.
///
/// # Errors
/// The compiler's verdict, or the one command to run when no toolchain could be had.
pub fn check() -> Result<(), String> {
    if rustup_target() {
        let mut build = cargo(&["build", "--release", "--target", TARGET]);
        return shell::run(build.args(CRATES));
    }
    eprintln!("rustup cannot install {TARGET}; falling back to Debian's compiler");
    debian::need(&DEBIAN_PACKAGES).map_err(|install| {
        format!(
            "no compiler for {TARGET}. Run one of these, then try again:\n\n    \
             rustup target add {TARGET}\n    {install}"
        )
    })?;
    let mut build = command(DEBIAN_CARGO, &["build", "--release", "--target", TARGET]);
    build.args(["-Z", "build-std=core"]).args(CRATES);
    // Debian's stable compiler needs leave to build `core`, and a folder of its own, because its
    // artefacts do not mix with those of rustup's. Its version may trail the one that the host crates
    // ask for; these two crates use nothing that new.
    build.args(["--ignore-rust-version", "--target-dir", "target/debian"]);
    build.env("RUSTC_BOOTSTRAP", "1").env("RUSTC", DEBIAN_RUSTC);
    without_rustup(&mut build);
    shell::run(&mut build)
}

/// Whether the target's `core` is installed for the toolchain in use, now or after asking rustup.
fn rustup_target() -> bool {
    let installed = || {
        shell::output(&mut command("rustup", &["target", "list", "--installed"]))
            .is_ok_and(|list| list.lines().any(|line| line.trim() == TARGET))
    };
    installed()
        || (shell::run(&mut command("rustup", &["target", "add", TARGET])).is_ok() && installed())
}

/// Takes away what rustup's cargo leaves in the environment of the programs that it runs.
fn without_rustup(command: &mut Command) {
    for name in ["CARGO", "RUSTUP_TOOLCHAIN", "RUSTUP_HOME", "RUSTC_WRAPPER", "RUSTDOC"] {
        command.env_remove(name);
    }
}
