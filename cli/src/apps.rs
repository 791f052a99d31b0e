//! Programs of their own that lie beside this one, as those of git and cargo do: `rollwalk bench` runs `rollwalk-bench`.

use miette::{IntoDiagnostic, miette};
use rollwalk_terminal::Exit;
use std::env::consts::EXE_SUFFIX;
use std::ffi::OsString;
use std::path::Path;
use std::process::Command;

/// Program of its own, with the folder of its package in the checkout.
pub struct App {
    /// Name of the program and of its package.
    pub name: &'static str,
    folder: &'static str,
}

/// Benchmarks, experiments, fault campaign and sweeps over designs.
pub const BENCH: App = App { name: "rollwalk-bench", folder: "apps/bench" };

/// Words behind a subcommand that another program reads.
#[derive(clap::Args)]
pub struct Words {
    /// Arguments of the program; `--help` prints them.
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
    /// The program does not lie beside this one (names the command that builds it), or does not start.
    pub fn run(&self, words: impl IntoIterator<Item = OsString>) -> miette::Result<Exit> {
        let this = std::env::current_exe().into_diagnostic()?;
        let path = this.with_file_name(format!("{}{EXE_SUFFIX}", self.name));
        if !path.exists() {
            return Err(miette!(
                help = format!("from the source folder of Rollwalk: {}", self.install(&this)),
                "this command is in a program of its own, and there is no {}",
                path.display()
            ));
        }
        let mut command = Command::new(&path);
        command.args(words);
        replace(command, &path)
    }

    /// Command that puts the program beside `this` one.
    fn install(&self, this: &Path) -> String {
        let folder = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
        let profile = this.parent().and_then(folder);
        let target = this.parent().and_then(Path::parent).and_then(folder);
        match (target.as_deref(), profile.as_deref()) {
            (Some("target"), Some("debug")) => format!("cargo build -p {}", self.name),
            (Some("target"), Some("release")) => format!("cargo build --release -p {}", self.name),
            _ => format!("cargo install --path {}", self.folder),
        }
    }
}

/// Becomes the program, so that signals and its exit code need no messenger.
#[cfg(unix)]
fn replace(mut command: Command, path: &Path) -> miette::Result<Exit> {
    use std::os::unix::process::CommandExt;
    let error = command.exec();
    Err(miette!("cannot run {}: {error}", path.display()))
}

#[cfg(not(unix))]
fn replace(mut command: Command, path: &Path) -> miette::Result<Exit> {
    let status =
        command.status().map_err(|error| miette!("cannot run {}: {error}", path.display()))?;
    std::process::exit(status.code().unwrap_or(1));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_program_is_named_with_the_one_command_that_builds_it() {
        for (this, expected) in [
            ("/src/target/release/rollwalk", "cargo build --release -p rollwalk-bench"),
            ("/src/target/debug/rollwalk", "cargo build -p rollwalk-bench"),
            ("/usr/local/bin/rollwalk", "cargo install --path apps/bench"),
        ] {
            assert_eq!(BENCH.install(Path::new(this)), expected);
        }
        // Beside the program of these tests lies none.
        let missing = App { name: "rollwalk-nothing", folder: "apps/nothing" };
        let report = format!("{:?}", missing.run([]).unwrap_err());
        assert!(report.contains("rollwalk-nothing"), "{report}");
    }
}
