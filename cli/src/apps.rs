//! Separate programs, found beside this one or on the path, like those of git and cargo: `rollwalk bench` runs
//! `rollwalk-bench`.

use miette::{IntoDiagnostic, miette};
use rollwalk_terminal::Exit;
use std::env::consts::EXE_SUFFIX;
use std::ffi::OsString;
use std::io;
use std::path::Path;
use std::process::Command;

/// Separate program, with the folder of its package in the checkout.
pub struct App {
    /// Name of the program, and of its package.
    pub name: &'static str,
    folder: &'static str,
}

/// Benchmarks, experiments, the fault campaign and sweeps over designs.
pub const BENCH: App = App { name: "rollwalk-bench", folder: "apps/bench" };

/// Arguments behind a subcommand, parsed by the separate program.
#[derive(clap::Args)]
pub struct ProgramArgs {
    /// Arguments of the program; `--help` prints its help.
    #[arg(
        value_name = "ARGUMENTS",
        num_args = 0..,
        trailing_var_arg = true,
        allow_hyphen_values = true
    )]
    pub words: Vec<OsString>,
}

impl App {
    /// Runs the program in place of this one.
    ///
    /// # Errors
    /// Returns an error if the program does not exist or does not start. The error contains the command that builds it.
    pub fn run(&self, words: impl IntoIterator<Item = OsString>) -> miette::Result<Exit> {
        let this = std::env::current_exe().into_diagnostic()?;
        let file = format!("{}{EXE_SUFFIX}", self.name);
        let beside = this.with_file_name(&file);
        let path = if beside.exists() { beside.as_path() } else { Path::new(&file) };
        let mut command = Command::new(path);
        command.args(words);
        let error = replace(command);
        let help =
            format!("install it from the source folder of Rollwalk: {}", self.install(&this));
        let why = match error.kind() {
            io::ErrorKind::NotFound => {
                format!("which is neither beside {} nor in a folder of PATH", this.display())
            }
            _ => format!("but {} cannot be run: {error}", path.display()),
        };
        Err(miette!(help = help, "this command requires the program {}, {why}", self.name))
    }

    /// Command that installs the program beside `this` one.
    fn install(&self, this: &Path) -> String {
        let folder = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
        let profile = this.parent().and_then(folder);
        let target = this.parent().and_then(Path::parent).and_then(folder);
        match (target.as_deref(), profile.as_deref()) {
            (Some("target"), Some("debug")) => format!("cargo build -p {}", self.name),
            (Some("target"), Some("release")) => format!("cargo build --release -p {}", self.name),
            _ => format!("cargo install --locked --path {}", self.folder),
        }
    }
}

/// Replaces this process by the program, so that signals and the exit code pass directly; returns only on failure.
#[cfg(unix)]
fn replace(mut command: Command) -> io::Error {
    use std::os::unix::process::CommandExt;
    command.exec()
}

#[cfg(not(unix))]
fn replace(mut command: Command) -> io::Error {
    match command.status() {
        Ok(status) => std::process::exit(status.code().unwrap_or(1)),
        Err(error) => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_program_is_named_with_the_one_command_that_builds_it() {
        for (this, expected) in [
            ("/src/target/release/rollwalk", "cargo build --release -p rollwalk-bench"),
            ("/src/target/debug/rollwalk", "cargo build -p rollwalk-bench"),
            ("/usr/local/bin/rollwalk", "cargo install --locked --path apps/bench"),
        ] {
            assert_eq!(BENCH.install(Path::new(this)), expected);
        }
        let missing = App { name: "rollwalk-nothing", folder: "apps/nothing" };
        let report = format!("{:?}", missing.run([]).unwrap_err());
        assert!(report.contains("rollwalk-nothing"), "{report}");
    }
}
