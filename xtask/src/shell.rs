//! Running other programs: always from the workspace root, with the command shown when it fails.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Root of the workspace: the folder above this crate.
pub fn workspace_root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace").into()
}

/// Where cargo puts what it builds.
pub fn target_folder() -> PathBuf {
    let chosen = std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into());
    workspace_root().join(chosen)
}

/// `program` with `args`, to be run from the workspace root.
pub fn command<S: AsRef<std::ffi::OsStr>>(program: &str, args: &[S]) -> Command {
    let mut command = Command::new(program);
    command.args(args).current_dir(workspace_root());
    command
}

/// A tool of the system's administrator, which a user's `PATH` may leave out.
pub fn system<S: AsRef<std::ffi::OsStr>>(program: &str, args: &[S]) -> Command {
    let found = ["/usr/sbin", "/sbin"].map(|folder| Path::new(folder).join(program));
    let found = found.iter().find(|path| path.exists()).and_then(|path| path.to_str());
    command(found.unwrap_or(program), args)
}

/// The cargo that runs this task, so that `cargo +toolchain xtask` stays on its toolchain.
pub fn cargo(args: &[&str]) -> Command {
    command(&std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()), args)
}

/// Runs to the end with the terminal attached.
///
/// # Errors
/// The command line and how it ended, when it does not exit with 0.
pub fn run(command: &mut Command) -> Result<(), String> {
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{}` failed: {status}", shown(command))),
        Err(error) => Err(format!("`{}` could not be started: {error}", shown(command))),
    }
}

/// Runs silently; whether the program exists and exits with 0.
pub fn succeeds(command: &mut Command) -> bool {
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|s| s.success())
}

/// Runs silently and returns what it printed.
///
/// # Errors
/// The command line and its own message, when it does not exit with 0.
pub fn output(command: &mut Command) -> Result<String, String> {
    bytes(command).map(|out| String::from_utf8_lossy(&out).into_owned())
}

/// Runs silently and returns what it wrote, byte by byte.
///
/// # Errors
/// The command line and its own message, when it does not exit with 0.
pub fn bytes(command: &mut Command) -> Result<Vec<u8>, String> {
    let out = command
        .output()
        .map_err(|error| format!("`{}` could not be started: {error}", shown(command)))?;
    if out.status.success() {
        Ok(out.stdout)
    } else {
        Err(format!("`{}` failed: {}", shown(command), String::from_utf8_lossy(&out.stderr)))
    }
}

fn shown(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
}
