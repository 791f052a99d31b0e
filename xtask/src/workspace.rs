//! Builds of the whole workspace. All of them select the same packages and features, so that each dependency is
//! compiled once, whatever is built after it.

use crate::shell;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Every package, and the features that are off by default.
const SELECTION: [&str; 3] =
    ["--workspace", "--features", "rollwalk-firmware/authenticated,rollwalk-firmware/ed25519"];

/// A cargo command on every package of the workspace.
pub fn cargo(args: &[&str]) -> Command {
    let mut cargo = shell::cargo(args);
    cargo.args(SELECTION);
    cargo
}

/// A program that a build has left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Program {
    /// Folder of its package.
    pub folder: PathBuf,
    /// Name of its target: a crate, or a file of `tests/`.
    pub name: String,
    /// Whether it runs tests.
    pub is_test: bool,
    /// The executable.
    pub path: PathBuf,
}

impl Program {
    /// Its name, and the folder that tells it from programs of the same name.
    pub fn shown(&self) -> String {
        let folder = self.folder.file_name().unwrap_or_default().to_string_lossy();
        format!("{folder}: {}", self.name)
    }

    /// The program, to be run in the folder of its package as cargo does with tests.
    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = shell::command(&self.path.to_string_lossy(), args);
        command.current_dir(&self.folder);
        command
    }

    /// The program, to run the tests that libtest's `selection` selects.
    ///
    /// # Errors
    /// It selects none: libtest would pass.
    pub fn tests(&self, selection: &[&str]) -> Result<Command, String> {
        let list = shell::output(self.command(selection).arg("--list"))?;
        if list.lines().any(|line| line.ends_with(": test")) {
            Ok(self.command(selection))
        } else {
            Err(format!("`{}` has no test for `{}`", self.name, selection.join(" ")))
        }
    }
}

/// Builds all programs and tests.
///
/// # Errors
/// The command line; the compiler's messages are on the terminal.
pub fn programs() -> Result<Vec<Program>, String> {
    build(&[])
}

/// Builds one program, with the features of all other builds.
///
/// # Errors
/// The command line; the compiler's messages are on the terminal.
pub fn program(folder: &str, name: &str) -> Result<Program, String> {
    one(folder, name, &[])
}

/// The same in the release profile.
///
/// # Errors
/// The command line; the compiler's messages are on the terminal.
pub fn optimised_program(folder: &str, name: &str) -> Result<Program, String> {
    one(folder, name, &["--release"])
}

fn one(folder: &str, name: &str, profile: &[&str]) -> Result<Program, String> {
    let mut build = cargo(&["build", "--bin", name, "--message-format", "json-render-diagnostics"]);
    build.args(profile);
    let messages = shell::output(build.stderr(Stdio::inherit()))?;
    let programs: Vec<_> = messages.lines().filter_map(of_message).collect();
    find(&programs, folder, name, false).cloned()
}

/// Builds all programs and tests in the release profile.
///
/// # Errors
/// The command line; the compiler's messages are on the terminal.
pub fn optimised_programs() -> Result<Vec<Program>, String> {
    build(&["--release"])
}

fn build(profile: &[&str]) -> Result<Vec<Program>, String> {
    // Without examples, which clippy checks.
    let json = ["--message-format", "json-render-diagnostics"];
    let mut build = cargo(&["test", "--no-run", "--tests"]);
    build.args(json);
    build.args(profile);
    let messages = shell::output(build.stderr(Stdio::inherit()))?;
    Ok(messages.lines().filter_map(of_message).collect())
}

/// The program `name` of the package in a `folder` of the workspace.
///
/// # Errors
/// There is no such program.
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

/// The program that one of cargo's messages is about.
fn of_message(line: &str) -> Option<Program> {
    let message: Value = serde_json::from_str(line).ok()?;
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
        let line = r#"{"reason":"compiler-artifact","manifest_path":"/w/tests/Cargo.toml","target":{"name":"vcan"},
            "profile":{"test":true},"executable":"/w/target/debug/deps/vcan-1"}"#;
        let (folder, path) = ("/w/tests".into(), "/w/target/debug/deps/vcan-1".into());
        let expected = Program { folder, name: "vcan".into(), is_test: true, path };
        assert_eq!(of_message(line), Some(expected));
        assert_eq!(of_message(r#"{"reason":"build-finished","success":true}"#), None);
        assert_eq!(of_message(r#"{"executable":null}"#), None);
    }
}
