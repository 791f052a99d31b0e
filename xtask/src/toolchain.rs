//! Parts of the Rust toolchain that are installed if they are missing: components of the current toolchain, nightly for Miri,
//! and other projects' programs that extend cargo.

use crate::shell::{self, command};
use std::process::Command;

/// Creates a command of the nightly toolchain's cargo.
pub fn nightly_cargo(args: &[&str]) -> Command {
    let mut words = vec!["run", "nightly", "cargo"];
    words.extend(args);
    let mut cargo = command("rustup", &words);
    // Variables of the cargo that runs this task select its own toolchain.
    for name in ["RUSTUP_TOOLCHAIN", "CARGO", "RUSTC", "RUSTDOC", "RUSTC_WRAPPER"] {
        cargo.env_remove(name);
    }
    cargo
}

/// Installs the nightly toolchain with the given components if it is missing.
///
/// # Errors
/// Returns the command that installs them if this machine cannot.
pub fn need_nightly(components: &[&str]) -> Result<(), String> {
    let installed = || {
        let list = ["component", "list", "--toolchain", "nightly", "--installed"];
        shell::output(&mut command("rustup", &list)).is_ok_and(|list| {
            components.iter().all(|wanted| list.lines().any(|line| line.starts_with(wanted)))
        })
    };
    if installed() {
        return Ok(());
    }
    // With named components, rustup selects the newest nightly that has them.
    let mut install = vec!["toolchain", "install", "nightly", "--profile", "minimal"];
    components.iter().for_each(|component| install.extend(["--component", component]));
    let done = shell::run(&mut command("rustup", &install));
    if done.is_ok() && installed() {
        return Ok(());
    }
    let why = done.err().map_or_else(String::new, |why| format!("{why}\n"));
    Err(format!(
        "{why}Miri requires the nightly toolchain. Install the toolchain \
        with:\n\n    rustup {}",
        install.join(" ")
    ))
}

/// Returns the program of a cargo subcommand. An installed program of any version is used; otherwise this version is built
/// below the target folder.
///
/// # Errors
/// Returns the command that installs the program if this machine cannot.
pub fn subcommand((name, version): (&str, &str)) -> Result<String, String> {
    let verb = name.trim_start_matches("cargo-");
    program((name, version), &[verb, "--version"], &[])
}

/// Returns a program from crates.io. An installed program of any version is used if `probe` succeeds; otherwise this version is
/// built below the target folder with these `options` of `cargo install`.
///
/// # Errors
/// Returns the command that installs the program if this machine cannot.
pub fn program(
    (name, version): (&str, &str),
    probe: &[&str],
    options: &[&str],
) -> Result<String, String> {
    let runs = |program: &str| shell::succeeds(&mut command(program, probe));
    if runs(name) {
        return Ok(name.to_owned());
    }
    let folder = shell::target_folder().join("tools");
    let program = folder.join("bin").join(name).to_string_lossy().into_owned();
    let _alone = shell::installing()?;
    if !runs(&program) {
        let mut install = shell::cargo(&["install", "--locked", "--version", version, name]);
        shell::run(install.args(options).arg("--root").arg(folder)).map_err(|why| {
            format!(
                "{why}\nthe step requires {name}. Install {name} with:\n\n    cargo install \
                --locked {name}"
            )
        })?;
    }
    Ok(program)
}

/// Installs a component of the current toolchain that rustup's minimal profile lacks, if it is missing.
///
/// # Errors
/// Returns the command that installs the component if this machine cannot.
pub fn need_component(component: &str) -> Result<(), String> {
    let subcommand = if component == "rustfmt" { "fmt" } else { component };
    if shell::succeeds(&mut shell::cargo(&[subcommand, "--version"])) {
        return Ok(());
    }
    shell::run(&mut command("rustup", &["component", "add", component])).map_err(|why| {
        format!("{why}\ninstall the missing component with `rustup component add {component}`")
    })
}
