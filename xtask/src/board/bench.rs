//! Test bench of a board (`apps/board-bench`), a program of the workspace: builds it, and runs it with images and the demo's
//! library.

use super::shown;
use crate::workspace::{self, Program};
use crate::{debian, shell};
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::{env, fs};

const MOTIONS: &str = "shipped/motions/agilebot_library.toml";
const QEMU: &str = "qemu-system-arm";

/// Measured cost of the demo on the emulated board.
pub struct BoardCost(Value);

impl BoardCost {
    /// Number in the bench's report.
    ///
    /// # Errors
    /// Returns an error if the report lacks the value.
    pub fn number(&self, name: &str) -> Result<f64, String> {
        self.0[name].as_f64().ok_or_else(|| format!("the report of the bench lacks {name}"))
    }
}

/// Test bench with its inputs.
pub struct Bench {
    program: PathBuf,
    /// Robot file; `None` for AgileBot.
    robot: Option<PathBuf>,
    /// Library of the demo; `None` plays a short motion instead.
    library: Option<PathBuf>,
    /// Output directory.
    out: PathBuf,
}

/// Generated module of a robot for an image.
pub struct Module {
    /// Path of the file.
    pub path: PathBuf,
    /// Description of the wiring between robot and board.
    pub wiring: String,
}

/// Files with the keys of an image.
#[derive(clap::Args, Default)]
pub struct KeyFiles {
    /// File with the robot's link key (`rollwalk keys new`). The robot then accepts only hosts with this key. The image
    /// contains the key, so only you can read the image files.
    #[arg(long, value_name = "FILE")]
    pub link_key: Option<PathBuf>,
    /// File with the public key of a pair (`rollwalk keys new-pair`). The robot then plays only libraries that were signed with
    /// the private key.
    #[arg(long, value_name = "KEY.pub.pem")]
    pub library_key: Option<PathBuf>,
}

impl Bench {
    /// Builds only the bench.
    ///
    /// # Errors
    /// Returns an error if the build fails.
    pub fn program() -> Result<Self, String> {
        Self::of(workspace::program("apps/board-bench", "rollwalk-board-bench")?)
    }

    /// Returns the bench from a completed build of the workspace.
    ///
    /// # Errors
    /// Returns an error if the build does not contain the bench.
    pub fn among(programs: &[Program]) -> Result<Self, String> {
        let program = workspace::find(programs, "apps/board-bench", "rollwalk-board-bench", false);
        Self::of(program?.clone())
    }

    fn of(Program { path: program, .. }: Program) -> Result<Self, String> {
        Ok(Self { program, robot: None, library: None, out: out()? })
    }

    /// Replaces the robot, and plays a short motion made for it instead of the demo's library.
    pub fn of_robot(self, robot: &Path) -> Self {
        Self { robot: Some(robot.into()), library: None, ..self }
    }

    /// Writes a robot's module for an image of a board.
    ///
    /// # Errors
    /// Returns an error if the robot file is wrong, or if the board has no port for one of its buses.
    pub fn module(&self, robot: &Path, board: &str) -> Result<Module, String> {
        let path = self.out.join(format!("{board}-robot.rs"));
        let mut image = self.command("image");
        // The path is relative to the user's folder.
        let here = env::current_dir().map_err(|error| format!("the current folder: {error}"))?;
        image.arg(board).arg("--robot").arg(robot).arg("--out").arg(&path).current_dir(here);
        shell::own_output(&mut image).map(|wiring| Module { path, wiring })
    }

    /// Writes the module of a shipped robot, for images that are not for a particular robot.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written, or if the bench fails.
    pub fn shipped(&self, robot: &str) -> Result<PathBuf, String> {
        let program = self.program.to_string_lossy();
        let module = shell::output(&mut shell::command(&program, &["--robot", robot, "config"]))?;
        let path =
            self.out.join(Path::new(robot).with_extension("rs").file_name().unwrap_or_default());
        // A rewritten file would be compiled again.
        if fs::read_to_string(&path).is_ok_and(|present| present == module) {
            return Ok(path);
        }
        fs::write(&path, module).map_err(|error| format!("{}: {error}", shown(&path)))?;
        Ok(path)
    }

    /// Returns the block with the keys of the given files for the image of a robot, in hexadecimal digits, which are secret.
    ///
    /// # Errors
    /// Returns an error if a file does not contain a key of the expected kind.
    pub fn key_block(&self, robot: &Path, keys: &KeyFiles) -> Result<String, String> {
        let here = env::current_dir().map_err(|error| format!("the current folder: {error}"))?;
        let mut block = self.command("key-block");
        block.arg("--robot").arg(robot).current_dir(here);
        for (option, path) in [("--link-key", &keys.link_key), ("--library-key", &keys.library_key)]
        {
            block.args(path.iter().flat_map(|path| [OsStr::new(option), path.as_os_str()]));
        }
        shell::echoed_output(&mut block)
    }

    /// Builds the bench, and the demo's library with the command line.
    ///
    /// # Errors
    /// Returns an error if the build fails, or if a motion has no plan.
    pub fn build() -> Result<Self, String> {
        let programs = workspace::programs()?;
        let bench = Self::among(&programs)?;
        let Program { path: rollwalk, .. } =
            workspace::find(&programs, "tests", "rollwalk-under-test", false)?;
        let library = bench.out.join("agilebot.rwl");
        let mut build = shell::command(&rollwalk.to_string_lossy(), &["library", "build", MOTIONS]);
        shell::output(build.arg("-o").arg(&library))?;
        Ok(Self { library: Some(library), ..bench })
    }

    /// Replays the demo from the memory of the emulated board.
    ///
    /// # Errors
    /// Returns the first difference from the simulation, or an error if the bench fails.
    pub fn replay(&self, image: &Path) -> Result<BoardCost, String> {
        need_qemu()?;
        let mut replay = self.command("replay");
        replay.arg(image).arg("--out").arg(&self.out).args(self.library());
        let report = shell::output(replay.stderr(std::process::Stdio::inherit()))?;
        serde_json::from_str(&report).map(BoardCost).map_err(|error| format!("the bench: {error}"))
    }

    /// Measures the cost of keys on the emulated board.
    ///
    /// # Errors
    /// Returns an error if the image or the bench fails.
    pub fn keys(&self, image: &Path) -> Result<BoardCost, String> {
        need_qemu()?;
        let report = shell::output(self.command("keys").arg(image))?;
        serde_json::from_str(&report).map(BoardCost).map_err(|error| format!("the bench: {error}"))
    }

    /// Runs the whole demo (`is_whole`) or a short scenario on the emulated board over its UART.
    ///
    /// # Errors
    /// Returns the first difference from the simulation, or an error if the bench fails.
    pub fn uart(&self, image: &Path, is_whole: bool) -> Result<(), String> {
        need_qemu()?;
        let mut uart = self.command("uart");
        uart.arg(image).arg("--out").arg(&self.out);
        if is_whole {
            uart.args(self.library());
        }
        shell::run(&mut uart)
    }

    /// Runs the short scenario on an image with keys, with a host that has these keys.
    ///
    /// # Errors
    /// Returns the first difference from the simulation, the refusal by the board, or an error if the bench fails.
    pub fn uart_with_keys(
        &self,
        image: &Path,
        link: Option<&Path>,
        signing: Option<&Path>,
    ) -> Result<(), String> {
        need_qemu()?;
        let mut uart = self.command("uart");
        uart.arg(image).arg("--out").arg(&self.out);
        for (option, path) in [("--link-key", link), ("--signing-key", signing)] {
            uart.args(path.iter().flat_map(|path| [OsStr::new(option), path.as_os_str()]));
        }
        shell::own_output(&mut uart).map(|said| print!("{said}"))
    }

    /// Prints the report of a NUCLEO-G474RE on a serial port and transfers the demo's library.
    ///
    /// # Errors
    /// Returns an error if the report is not acceptable, or if the line fails.
    pub fn visit(&self, port: &Path) -> Result<(), String> {
        shell::run(self.command("visit").arg(port).args(&self.library))
    }

    fn library(&self) -> Vec<&OsStr> {
        self.library.iter().flat_map(|path| [OsStr::new("--library"), path.as_os_str()]).collect()
    }

    fn command(&self, task: &str) -> std::process::Command {
        let mut command = shell::command(&self.program.to_string_lossy(), &[task]);
        if let Some(robot) = &self.robot {
            command.arg("--robot").arg(robot);
        }
        command
    }
}

/// Returns the folder for the output of the bench.
fn out() -> Result<PathBuf, String> {
    let out = shell::target_folder().join("board");
    fs::create_dir_all(&out).map_err(|error| format!("{}: {error}", shown(&out)))?;
    Ok(out)
}

fn need_qemu() -> Result<(), String> {
    if shell::succeeds(&mut shell::command(QEMU, &["--version"])) {
        return Ok(());
    }
    debian::need(&[QEMU])
        .map_err(|install| format!("the board runs in QEMU. On Debian:\n\n    {install}"))
}
