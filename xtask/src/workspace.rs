//! Builds of the whole workspace. They all select the same packages and features, so each dependency is compiled only once.
//!
//! Clippy is the compiler of our own crates: it lints them while it compiles them. `cargo clippy` would also check all
//! dependencies, but compile none of them.

use crate::{changes, shell, toolchain};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// Arguments that select all packages, and features that are off by default.
const SELECTION: [&str; 3] =
    ["--workspace", "--features", "rollwalk-firmware/authenticated,rollwalk-firmware/ed25519"];
/// Arguments that exclude packages which no other package uses and which have many dependencies of their own.
const COSTLY: [&str; 4] = ["--exclude", "rollwalk-ros2", "--exclude", "rollwalk-python"];
/// Folders of the packages in [`COSTLY`]. If none of them has changed, `cargo xtask test` leaves these packages to `nightly`.
pub const APART: [&str; 3] = ["apps/ros2", "apps/python", "apps/packaging/rollwalk_ros2"];

/// True if the builds of this process include the packages of [`COSTLY`].
static HAS_ALL: OnceLock<bool> = OnceLock::new();

/// Includes every package in the builds of this process.
pub fn select_all() {
    // The cell is set only once; a previous build may have set it.
    let _ = HAS_ALL.set(true);
}

fn selection() -> Vec<&'static str> {
    // Without git, everything is built.
    let has_changed =
        || changes::files(None).map_or(true, |files| changes::concern(&files, &APART));
    let has_all = *HAS_ALL.get_or_init(has_changed);
    SELECTION.iter().chain(if has_all { &[][..] } else { &COSTLY }).copied().collect()
}

/// Options of clippy, each followed by the separator of options.
const DENY_WARNINGS: &str = "-D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__";

/// Creates a cargo command on the packages of the workspace.
pub fn cargo(args: &[&str]) -> Command {
    let mut cargo = shell::cargo(args);
    cargo.args(selection());
    cargo
}

/// Creates a cargo command with clippy as the compiler of our crates and its warnings denied, with the settings of `cargo
/// clippy`.
fn linted(args: &[&str]) -> Result<Command, String> {
    toolchain::need_component("clippy")?;
    let mut cargo = cargo(args);
    let clippy = Path::new(cargo.get_program()).with_file_name("clippy-driver");
    cargo.env("RUSTC_WORKSPACE_WRAPPER", clippy).env("CLIPPY_ARGS", DENY_WARNINGS);
    Ok(cargo)
}

/// Program built by cargo.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Program {
    /// Folder of the program's package.
    pub folder: PathBuf,
    /// Name of the program's target: a crate, or a file of `tests/`.
    pub name: String,
    /// True for a test program.
    pub is_test: bool,
    pub path: PathBuf,
}

impl Program {
    /// Name with the folder, which distinguishes programs of the same name.
    pub fn shown(&self) -> String {
        let folder = self.folder.file_name().unwrap_or_default().to_string_lossy();
        format!("{folder}: {}", self.name)
    }

    /// Creates a command that runs the program in the folder of its package, as cargo does with tests.
    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = shell::command(&self.path.to_string_lossy(), args);
        command.current_dir(&self.folder);
        command
    }

    /// Creates a command that runs the tests selected by `selection`, in the syntax of libtest.
    ///
    /// # Errors
    /// Returns an error if no test is selected, because libtest would then succeed.
    pub fn tests(&self, selection: &[&str]) -> Result<Command, String> {
        let command = self.command_if_any(selection)?;
        command.ok_or_else(|| format!("`{}` has no test for `{}`", self.name, selection.join(" ")))
    }

    /// Returns a command that runs a selection of tests; `None` if no test is selected.
    ///
    /// # Errors
    /// Returns the output of a program that does not list its tests.
    pub fn command_if_any(&self, selection: &[&str]) -> Result<Option<Command>, String> {
        let list = shell::output(self.command(selection).arg("--list"))?;
        let is_selected = list.lines().any(|line| line.ends_with(": test"));
        Ok(is_selected.then(|| self.command(selection)))
    }
}

/// Builds every target with clippy's warnings denied: programs and tests, and also examples and benchmarks, which are never
/// run.
///
/// # Errors
/// Returns the command line if the build fails; warnings and errors are printed on the terminal.
pub fn programs() -> Result<Vec<Program>, String> {
    // `--all-targets` would make test programs of programs without tests.
    of(linted(&["build", "--lib", "--bins", "--tests", "--examples", "--bench", "*"])?)
}

/// Lints every target without building it.
///
/// # Errors
/// Returns the command line if the build fails; warnings and errors are printed on the terminal.
pub fn lint() -> Result<(), String> {
    shell::run(&mut linted(&[
        "check",
        "--quiet",
        "--lib",
        "--bins",
        "--tests",
        "--examples",
        "--bench",
        "*",
    ])?)
}

/// Builds the tests of some packages, with the features that these packages select instead of those of the workspace.
///
/// # Errors
/// Returns the command line if the build fails; the compiler's messages are printed on the terminal.
pub fn tests_of(packages: &[&str]) -> Result<Vec<Program>, String> {
    let mut test = shell::cargo(&["test", "--no-run", "--tests"]);
    test.args(packages.iter().flat_map(|name| ["--package", name]));
    of(test)
}

/// Builds one program without clippy, for users who do not have it.
///
/// # Errors
/// Returns the command line if the build fails; the compiler's messages are printed on the terminal.
pub fn program(folder: &str, name: &str) -> Result<Program, String> {
    find(&of(cargo(&["build", "--bin", name]))?, folder, name, false).cloned()
}

/// Builds one program in the release profile without clippy.
///
/// # Errors
/// Returns the command line if the build fails; the compiler's messages are printed on the terminal.
pub fn optimised_program(folder: &str, name: &str) -> Result<Program, String> {
    find(&of(cargo(&["build", "--release", "--bin", name]))?, folder, name, false).cloned()
}

/// Builds all programs and tests in the release profile.
///
/// # Errors
/// Returns the command line if the build fails; the compiler's messages are printed on the terminal.
pub fn optimised_programs() -> Result<Vec<Program>, String> {
    of(cargo(&["test", "--release", "--no-run", "--tests"]))
}

/// Runs the examples in the documentation of the crates, reusing the crates that [`programs`] built.
///
/// # Errors
/// Returns the command line if an example fails; the failures are printed on the terminal.
pub fn documented_examples() -> Result<(), String> {
    shell::run(&mut linted(&["test", "--doc"])?)
}

/// Runs a build, and returns the programs that it produced.
fn of(mut build: Command) -> Result<Vec<Program>, String> {
    build.args(["--message-format", "json-render-diagnostics"]);
    // After a failed build, messages for programs repeat what the terminal shows.
    let failed = |error: String| match error.split_once(" failed: ") {
        Some((command, _)) => format!("{command} failed"),
        None => error,
    };
    let messages = shell::output(build.stderr(Stdio::inherit())).map_err(failed)?;
    Ok(messages.lines().filter_map(of_message).collect())
}

/// Finds the program `name` of the package in a `folder` of the workspace.
///
/// # Errors
/// Returns an error if the program does not exist.
pub fn find<'a>(
    programs: &'a [Program],
    folder: &str,
    name: &str,
    is_test: bool,
) -> Result<&'a Program, String> {
    let folder = shell::workspace_root().join(folder);
    let is_it = |one: &&Program| one.folder == folder && one.name == name && one.is_test == is_test;
    programs
        .iter()
        .find(is_it)
        .ok_or_else(|| format!("cargo built no `{name}` in {}", folder.display()))
}

/// Parses one of cargo's messages; returns `None` if it is not about a program or test.
fn of_message(line: &str) -> Option<Program> {
    let message: Value = serde_json::from_str(line).ok()?;
    if ["example", "bench"].contains(&message["target"]["kind"][0].as_str()?) {
        return None;
    }
    let path = PathBuf::from(message["executable"].as_str()?);
    let folder = Path::new(message["manifest_path"].as_str()?).parent()?.into();
    let name = message["target"]["name"].as_str()?.into();
    Some(Program { folder, name, is_test: message["profile"]["test"] == true, path })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_come_from_cargo_s_messages() {
        let line = r#"{"reason":"compiler-artifact","manifest_path":"/w/tests/Cargo.toml","target":{"kind":["test"],"name":"vcan"},
            "profile":{"test":true},"executable":"/w/target/debug/deps/vcan-1"}"#;
        let (folder, path) = ("/w/tests".into(), "/w/target/debug/deps/vcan-1".into());
        let expected = Program { folder, name: "vcan".into(), is_test: true, path };
        assert_eq!(of_message(line), Some(expected));
        // No step runs these.
        assert_eq!(of_message(&line.replace(r#"["test"]"#, r#"["example"]"#)), None);
        assert_eq!(of_message(r#"{"reason":"build-finished","success":true}"#), None);
        assert_eq!(of_message(r#"{"executable":null}"#), None);
    }
}
