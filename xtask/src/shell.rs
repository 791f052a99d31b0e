//! Execution of other programs in the workspace root; errors contain the command line.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Root of the workspace: the parent folder of this crate.
pub fn workspace_root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace").into()
}

/// Cargo's target folder.
pub fn target_folder() -> PathBuf {
    let chosen = std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into());
    workspace_root().join(chosen)
}

/// Creates a command that runs in the workspace root.
pub fn command<S: AsRef<std::ffi::OsStr>>(program: &str, args: &[S]) -> Command {
    let mut command = Command::new(program);
    command.args(args).current_dir(workspace_root());
    command
}

/// Creates a command for a program of the system administrator, which may be outside of the user's `PATH`.
pub fn system<S: AsRef<std::ffi::OsStr>>(program: &str, args: &[S]) -> Command {
    let found = ["/usr/sbin", "/sbin"].map(|folder| Path::new(folder).join(program));
    let found = found.iter().find(|path| path.exists()).and_then(|path| path.to_str());
    command(found.unwrap_or(program), args)
}

/// Creates a command whose process is killed when this process ends for any reason. The starting thread must outlive the
/// command, because the kernel kills the command when that thread ends.
pub fn tied(program: &str) -> Command {
    command("setpriv", &["--pdeathsig", "KILL", "--", program])
}

/// Creates a command of the cargo that runs this task, so that `cargo +toolchain xtask` keeps its toolchain.
pub fn cargo(args: &[&str]) -> Command {
    command(&std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()), args)
}

/// Runs a command with its output on the terminal.
///
/// # Errors
/// Returns the command line and the exit status if that is not 0.
pub fn run(command: &mut Command) -> Result<(), String> {
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{}` failed: {status}", shown(command))),
        Err(error) => Err(format!("`{}` could not be started: {error}", shown(command))),
    }
}

/// Runs a command silently. Returns true if it exists and exits with 0.
pub fn succeeds(command: &mut Command) -> bool {
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|s| s.success())
}

/// Runs a command silently and returns its output as text.
///
/// # Errors
/// Returns the command line and the complete output if the command does not exit with 0.
pub fn output(command: &mut Command) -> Result<String, String> {
    bytes(command).map(|out| String::from_utf8_lossy(&out).into_owned())
}

/// Runs a command and returns its output. Errors contain only the command's own messages.
///
/// # Errors
/// Returns the error output if the command does not exit with 0.
pub fn own_output(command: &mut Command) -> Result<String, String> {
    answer(command).map(|out| String::from_utf8_lossy(&out.stdout).into_owned())
}

fn answer(command: &mut Command) -> Result<Output, String> {
    let out = command
        .output()
        .map_err(|error| format!("`{}` could not be started: {error}", shown(command)))?;
    if out.status.success() {
        Ok(out)
    } else {
        Err(String::from_utf8_lossy(&out.stderr).trim_end().into())
    }
}

/// Runs a command like [`own_output`]; on success also copies the error output to the terminal.
///
/// # Errors
/// Returns the error output if the command does not exit with 0.
pub fn echoed_output(command: &mut Command) -> Result<String, String> {
    let out = answer(command)?;
    eprint!("{}", String::from_utf8_lossy(&out.stderr));
    Ok(String::from_utf8_lossy(&out.stdout).into_owned())
}

/// Runs a command silently and returns its output.
///
/// # Errors
/// Returns the command line and the complete output if the command does not exit with 0, because tests report failures on
/// stdout.
pub fn bytes(command: &mut Command) -> Result<Vec<u8>, String> {
    let out = command
        .output()
        .map_err(|error| format!("`{}` could not be started: {error}", shown(command)))?;
    if out.status.success() {
        Ok(out.stdout)
    } else {
        let (said, errors) =
            (String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
        Err(format!("`{}` failed: {said}{errors}", shown(command)))
    }
}

/// Waits until no other process of this checkout is installing packages, and blocks others while the returned lock exists.
/// Steps run in parallel, but package managers refuse to.
///
/// # Errors
/// Returns an error if the lock file cannot be created.
pub fn installing() -> Result<File, String> {
    let path = target_folder().join("install.lock");
    let failed = |error: std::io::Error| format!("{}: {error}", path.display());
    fs::create_dir_all(target_folder()).map_err(failed)?;
    let file = File::create(&path).map_err(failed)?;
    file.lock().map_err(failed)?;
    Ok(file)
}

fn shown(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
}
