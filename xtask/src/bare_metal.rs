//! Builds the controller's crates for the Cortex-M4F, where there is neither std nor alloc.
//!
//! The rustup target is installed when missing. Where rustup cannot download it, Debian's own
//! compiler, which ships with matching sources of `core`, builds the same crates.

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
    debian_toolchain()?;
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

fn debian_toolchain() -> Result<(), String> {
    let installed = || {
        DEBIAN_PACKAGES.iter().all(|package| {
            let query = ["-W", "-f=${Status}", package];
            shell::output(&mut command("dpkg-query", &query))
                .is_ok_and(|s| s.ends_with(" installed"))
        })
    };
    if installed() {
        return Ok(());
    }
    let mut install = vec!["install", "-y", "--no-install-recommends"];
    install.extend(DEBIAN_PACKAGES);
    let is_root = shell::output(&mut command("id", &["-u"])).is_ok_and(|id| id.trim() == "0");
    if is_root && shell::run(&mut command("apt-get", &["update"])).is_ok() {
        let mut apt = command("apt-get", &install);
        if shell::run(apt.env("DEBIAN_FRONTEND", "noninteractive")).is_ok() && installed() {
            return Ok(());
        }
    }
    Err(format!(
        "no compiler for {TARGET}. Run one of these, then try again:\n\n    \
         rustup target add {TARGET}\n    sudo apt-get {}",
        install.join(" ")
    ))
}

/// Takes away what rustup's cargo leaves in the environment of the programs that it runs.
fn without_rustup(command: &mut Command) {
    for name in ["CARGO", "RUSTUP_TOOLCHAIN", "RUSTUP_HOME", "RUSTC_WRAPPER", "RUSTDOC"] {
        command.env_remove(name);
    }
}
