//! The bench around a board (`apps/board-bench`), a program of the workspace: builds it, runs it, and hands it
//! images and the demo's library.

use super::shown;
use crate::workspace::{self, Program};
use crate::{debian, shell};
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::{env, fs};

const MOTIONS: &str = "shipped/motions/agilebot_library.toml";
const QEMU: &str = "qemu-system-arm";

/// Cost of the demo on the emulated board.
pub struct Figures(Value);

impl Figures {
    /// A number of the bench's report.
    ///
    /// # Errors
    /// The report lacks it.
    pub fn number(&self, name: &str) -> Result<f64, String> {
        self.0[name].as_f64().ok_or_else(|| format!("the bench reports no {name}"))
    }
}

/// The bench with what it needs.
pub struct Bench {
    program: PathBuf,
    /// The robot and its library: AgileBot and the demo's without, the short motion of another robot.
    robot: Option<PathBuf>,
    library: Option<PathBuf>,
    /// Output directory.
    out: PathBuf,
}

/// The robot's part of an image.
pub struct Module {
    /// The file.
    pub path: PathBuf,
    /// Wiring between robot and board, in words.
    pub wiring: String,
}

/// Files with the keys of an image.
#[derive(clap::Args, Default)]
pub struct KeyFiles {
    /// File with the robot's link key (`rollwalk keys new`). The robot then accepts only hosts that have it. The image contains
    /// the key, so only you can read the image files.
    #[arg(long, value_name = "FILE")]
    pub link_key: Option<PathBuf>,
    /// File with the public key of a pair (`rollwalk keys new-pair`). The robot then plays only libraries signed with the private
    /// key.
    #[arg(long, value_name = "KEY.pub.pem")]
    pub library_key: Option<PathBuf>,
}

impl Bench {
    /// Builds the bench alone.
    ///
    /// # Errors
    /// The compiler's verdict.
    pub fn program() -> Result<Self, String> {
        Self::of(workspace::program("apps/board-bench", "rollwalk-board-bench")?)
    }

    /// The bench that a build of the workspace has left.
    ///
    /// # Errors
    /// There is none.
    pub fn among(programs: &[Program]) -> Result<Self, String> {
        let program = workspace::find(programs, "apps/board-bench", "rollwalk-board-bench", false);
        Self::of(program?.clone())
    }

    fn of(Program { path: program, .. }: Program) -> Result<Self, String> {
        Ok(Self { program, robot: None, library: None, out: out()? })
    }

    /// The same for a robot, whose motion is a short one made for it.
    pub fn of_robot(self, robot: &Path) -> Self {
        Self { robot: Some(robot.into()), library: None, ..self }
    }

    /// Writes a robot's module for an image of a board.
    ///
    /// # Errors
    /// What is wrong with the file, or which bus the board has no port for.
    pub fn module(&self, robot: &Path, board: &str) -> Result<Module, String> {
        let path = self.out.join(format!("{board}-robot.rs"));
        let mut image = self.command("image");
        // The file is where the user is.
        let here = env::current_dir().map_err(|error| format!("the current folder: {error}"))?;
        image.arg(board).arg("--robot").arg(robot).arg("--out").arg(&path).current_dir(here);
        shell::said(&mut image).map(|wiring| Module { path, wiring })
    }

    /// Writes the module of a robot that ships, for images that are for no other robot.
    ///
    /// # Errors
    /// The file, or a failure of the bench.
    pub fn shipped(&self, robot: &str) -> Result<PathBuf, String> {
        let program = self.program.to_string_lossy();
        let module = shell::output(&mut shell::command(&program, &["--robot", robot, "config"]))?;
        let path =
            self.out.join(Path::new(robot).with_extension("rs").file_name().unwrap_or_default());
        // A file that is written anew would be compiled anew.
        if fs::read_to_string(&path).is_ok_and(|present| present == module) {
            return Ok(path);
        }
        fs::write(&path, module).map_err(|error| format!("{}: {error}", shown(&path)))?;
        Ok(path)
    }

    /// The block with the keys of these files for the image of a robot, in hexadecimal digits, which are a secret.
    ///
    /// # Errors
    /// Which file is no such key, and what it should be.
    pub fn key_block(&self, robot: &Path, keys: &KeyFiles) -> Result<String, String> {
        let here = env::current_dir().map_err(|error| format!("the current folder: {error}"))?;
        let mut block = self.command("key-block");
        block.arg("--robot").arg(robot).current_dir(here);
        for (option, path) in [("--link-key", &keys.link_key), ("--library-key", &keys.library_key)]
        {
            block.args(path.iter().flat_map(|path| [OsStr::new(option), path.as_os_str()]));
        }
        shell::noted(&mut block)
    }

    /// Builds the bench, and the demo's library with the command line.
    ///
    /// # Errors
    /// The compiler's verdict, or a motion without a plan.
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
    /// The first difference from the simulation, or a failure of the bench.
    pub fn replay(&self, image: &Path) -> Result<Figures, String> {
        need_qemu()?;
        let mut replay = self.command("replay");
        replay.arg(image).arg("--out").arg(&self.out).args(self.library());
        let report = shell::output(replay.stderr(std::process::Stdio::inherit()))?;
        serde_json::from_str(&report).map(Figures).map_err(|error| format!("the bench: {error}"))
    }

    /// Measures what keys cost on the emulated board.
    ///
    /// # Errors
    /// The image that does it, or the bench, failed.
    pub fn keys(&self, image: &Path) -> Result<Figures, String> {
        need_qemu()?;
        let report = shell::output(self.command("keys").arg(image))?;
        serde_json::from_str(&report).map(Figures).map_err(|error| format!("the bench: {error}"))
    }

    /// Runs a short scenario on the emulated board over its UART, or the whole demo.
    ///
    /// # Errors
    /// The first difference from the simulation, or a failure of the bench.
    pub fn uart(&self, image: &Path, is_whole: bool) -> Result<(), String> {
        need_qemu()?;
        let mut uart = self.command("uart");
        uart.arg(image).arg("--out").arg(&self.out);
        if is_whole {
            uart.args(self.library());
        }
        shell::run(&mut uart)
    }

    /// Runs the short scenario on an image with keys, from a host with these.
    ///
    /// # Errors
    /// The first difference from the simulation, what the board refused, or a failure of the bench.
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
        shell::said(&mut uart).map(|said| print!("{said}"))
    }

    /// Prints the report of a NUCLEO-G474RE at a serial port and transfers the demo's library.
    ///
    /// # Errors
    /// A report that is not acceptable, or a failure of the line.
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

/// The folder for what the bench writes.
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
