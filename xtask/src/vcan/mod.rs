//! `cargo xtask vcan`: runs a command on a machine with SocketCAN, on the interfaces `vcan0`, `vcan1` and `vcan2`.
//!
//! ```text
//! place: this kernel has vcan? ── yes ──> here
//!           └─ no ──> kernel (Debian's) + modules ──> initramfs ──> guest (QEMU) ──> status
//! ```
//!
//! The virtual machine has its own clock: see [`guest`].

mod guest;
mod init;
mod kernel;
mod modules;
mod script;
mod status;
mod suite;
mod target;

use crate::shell;
use guest::Guest;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};
use target::Target;

/// Interfaces for a command, up and with the kernel's default settings.
const INTERFACES: [&str; 3] = ["vcan0", "vcan1", "vcan2"];
/// Environment variable with the folder for files to keep.
const RESULTS: &str = "ROLLWALK_RESULTS";

/// Options of the command.
#[derive(clap::Args)]
pub struct Options {
    /// Run in the virtual machine even if this kernel has vcan: its clock does not depend on the load of this machine.
    #[arg(long)]
    guest: bool,
    /// Folder for files to keep; the command reads its path from `ROLLWALK_RESULTS`. Other files that the command writes in the
    /// virtual machine are lost.
    #[arg(long, value_name = "FOLDER")]
    results: Option<PathBuf>,
    /// Timeout by this machine's clock, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    timeout: u64,
    /// Command with its arguments. The default is the full tests of `tests/vcan/`.
    #[arg(last = true)]
    command: Vec<String>,
}

impl Options {
    fn target(&self) -> Result<Target, String> {
        if self.guest { Ok(Target::Guest) } else { target::decide() }
    }
}

/// Runs the tests on real CAN interfaces.
///
/// # Errors
/// Returns the failed tests. If a program is missing, the error contains the command that installs it.
pub fn check() -> Result<(), String> {
    suite::run(target::decide()?)
}

/// Runs the command, or the full tests, on a machine with SocketCAN, and returns the exit status.
///
/// # Errors
/// Returns an error if the command did not end. If a program is missing, the error contains the command that installs it.
pub fn run(options: &Options) -> Result<ExitCode, String> {
    ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed))
        .map_err(|error| format!("cannot set a handler for Ctrl-C: {error}"))?;
    let command = &options.command;
    if command.is_empty() {
        return suite::run(options.target()?).map(|()| ExitCode::SUCCESS);
    }
    let results = options.results.as_deref().map(absolute).transpose()?;
    let timeout = Duration::from_secs(options.timeout);
    let code = match options.target()? {
        Target::Here => here(command, results.as_deref(), timeout)?,
        Target::Guest => Guest::prepare()?.run(command, results.as_deref(), timeout)?,
    };
    Ok(ExitCode::from(code))
}

/// True if the tests run in a virtual machine, as they do if this kernel has no vcan.
pub fn in_virtual_machine() -> bool {
    target::decide() == Ok(Target::Guest)
}

/// Runs a command on this machine.
fn here(command: &[String], results: Option<&Path>, timeout: Duration) -> Result<u8, String> {
    eprintln!("this kernel has vcan: running here");
    let mut process = shell::command(&command[0], &command[1..]);
    if let Some(results) = results {
        process.env(RESULTS, results);
    }
    let status = wait(spawn(&mut process)?, timeout)?;
    status::of_process(status)
}

fn spawn(command: &mut Command) -> Result<Child, String> {
    let name = command.get_program().to_string_lossy().into_owned();
    command.spawn().map_err(|error| format!("`{name}` could not be started: {error}"))
}

/// True after Ctrl-C: the running command is then ended and its folder removed.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Waits for the end of a process; kills it at the timeout or on Ctrl-C.
fn wait(mut child: Child, timeout: Duration) -> Result<std::process::ExitStatus, String> {
    let start = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Ok(status),
            Ok(None) if start.elapsed() < timeout && !INTERRUPTED.load(Ordering::Relaxed) => {
                sleep(Duration::from_millis(20));
            }
            ended => {
                // The process may have ended already.
                let _ = child.kill();
                let _ = child.wait();
                return Err(match ended {
                    Err(error) => format!("cannot wait for the command: {error}"),
                    Ok(_) if INTERRUPTED.load(Ordering::Relaxed) => "interrupted".into(),
                    Ok(_) => format!("the command did not end within {timeout:?} and was stopped"),
                });
            }
        }
    }
}

/// Absolute path of a folder, which is created if it is missing.
fn absolute(folder: &Path) -> Result<PathBuf, String> {
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    fs::create_dir_all(folder).map_err(failed)?;
    folder.canonicalize().map_err(failed)
}

/// Folder of kernels and results, kept between runs.
fn cache() -> Result<PathBuf, String> {
    absolute(&shell::target_folder().join("vcan"))
}
