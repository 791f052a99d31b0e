//! Builds the controller's crates for the Cortex-M4F, where there is neither std nor alloc.
//!
//! The rustup target is installed when missing. Where rustup cannot download it, Debian's own
//! compiler, which ships with matching sources of `core`, builds the same crates.

use crate::debian;
use crate::shell::{self, cargo, command};
use std::path::PathBuf;
use std::process::Command;

const TARGET: &str = "thumbv7em-none-eabihf";
const CRATES: [&str; 4] = ["-p", "rollwalk-protocol", "-p", "rollwalk-firmware"];
const DEBIAN_PACKAGES: [&str; 4] = ["rustc-web", "cargo-web", "rust-web-src", "lld"];
const DEBIAN_CARGO: &str = "/usr/bin/cargo";
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";

/// `cargo build --release` for the target, to be completed and run, and where the artefacts will be.
pub struct Build {
    /// The command.
    pub cargo: Command,
    /// Their folder.
    pub artefacts: PathBuf,
}

/// Builds the controller's crates.
///
/// # Errors
/// The compiler's verdict, or the one command to run when no toolchain could be had.
pub fn check() -> Result<(), String> {
    shell::run(build()?.cargo.args(CRATES))
}

/// A build with the first toolchain that can.
///
/// # Errors
/// The one command to run when no toolchain could be had.
pub fn build() -> Result<Build, String> {
    let rustup = rustup_target();
    // Each has a folder of its own: the artefacts of the two compilers do not mix.
    let folder = shell::target_folder().join(if rustup { "bare-metal" } else { "debian" });
    let artefacts = folder.join(TARGET).join("release");
    let args = ["build", "--release", "--target", TARGET];
    if rustup {
        let mut cargo = cargo(&args);
        cargo.arg("--target-dir").arg(folder);
        return Ok(Build { cargo, artefacts });
    }
    eprintln!("rustup cannot install {TARGET}; falling back to Debian's compiler");
    debian::need(&DEBIAN_PACKAGES).map_err(|install| {
        format!(
            "no compiler for {TARGET}. Run one of these, then try again:\n\n    \
             rustup target add {TARGET}\n    {install}"
        )
    })?;
    let mut cargo = command(DEBIAN_CARGO, &args);
    // Debian's stable compiler needs leave to build `core`. Its version may trail the one that the
    // host crates ask for; these crates use nothing that new.
    cargo.args(["-Z", "build-std=core", "--ignore-rust-version", "--target-dir"]).arg(folder);
    cargo.env("RUSTC_BOOTSTRAP", "1").env("RUSTC", DEBIAN_RUSTC);
    cargo.env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER", "ld.lld");
    without_rustup(&mut cargo);
    Ok(Build { cargo, artefacts })
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
