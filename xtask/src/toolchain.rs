//! Parts of the Rust toolchain that are installed when they are missing: components of the one in use, nightly, which
//! alone has Miri, and programs of other projects that extend cargo.

use crate::shell::{self, command};
use std::process::Command;

/// Cargo of the nightly toolchain.
pub fn nightly_cargo(args: &[&str]) -> Command {
    let mut words = vec!["run", "nightly", "cargo"];
    words.extend(args);
    let mut cargo = command("rustup", &words);
    // Variables of the cargo that runs this task name its own toolchain.
    for name in ["RUSTUP_TOOLCHAIN", "CARGO", "RUSTC", "RUSTDOC", "RUSTC_WRAPPER"] {
        cargo.env_remove(name);
    }
    cargo
}

/// Makes sure that the nightly toolchain is installed with these components.
///
/// # Errors
/// The one command that installs them, when this machine cannot.
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
    // With the components named, rustup takes the newest nightly that has them.
    let mut install = vec!["toolchain", "install", "nightly", "--profile", "minimal"];
    components.iter().for_each(|component| install.extend(["--component", component]));
    let done = shell::run(&mut command("rustup", &install));
    if done.is_ok() && installed() {
        return Ok(());
    }
    let why = done.err().map_or_else(String::new, |why| format!("{why}\n"));
    Err(format!("{why}Miri needs the nightly toolchain:\n\n    rustup {}", install.join(" ")))
}

/// The program behind a cargo subcommand of this name and version: the machine's own, of any version, or else built below
/// the target folder.
///
/// # Errors
/// The one command that installs it, when this machine cannot.
pub fn subcommand((name, version): (&str, &str)) -> Result<String, String> {
    let verb = name.trim_start_matches("cargo-");
    program((name, version), &[verb, "--version"], &[])
}

/// A program from crates, of this name and version: the machine's own, of any version, that answers to `probe`, or else
/// built below the target folder with these `options` of `cargo install`.
///
/// # Errors
/// The one command that installs it, when this machine cannot.
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
            format!("{why}\nthe step needs {name}:\n\n    cargo install --locked {name}")
        })?;
    }
    Ok(program)
}

/// Makes sure that the toolchain in use has a component that rustup's minimal profile leaves out.
///
/// # Errors
/// The one command that installs it, when this machine cannot.
pub fn need_component(component: &str) -> Result<(), String> {
    let subcommand = if component == "rustfmt" { "fmt" } else { component };
    if shell::succeeds(&mut shell::cargo(&[subcommand, "--version"])) {
        return Ok(());
    }
    shell::run(&mut command("rustup", &["component", "add", component])).map_err(|why| {
        format!("{why}\n{component} is needed; install it with `rustup component add {component}`")
    })
}
