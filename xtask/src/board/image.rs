//! The release images of the boards.

use super::bench::Bench;
use crate::bare_metal::{self, CORTEX_M4F, CORTEX_M33F};
use crate::shell;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Environment variable with the path of the robot's module (`firmware/boards/robot_module.rs`).
const ROBOT: &str = "ROLLWALK_ROBOT";

/// Flag for compact loops in the sha2 crate. Its unrolled rounds of SHA-256 and SHA-512 take 30 KiB.
const COMPACT_HASHES: &str = "--cfg sha2_backend_soft=\"compact\"";

/// Robot of the boards with CAN.
const AGILEBOT: &str = "shipped/robots/agilebot.toml";

/// Largest number of channels without the feature `many-channels`.
const FEW_CHANNELS: usize = 24;

/// Number of channels of a generated module.
fn channels(module: &Path) -> Result<usize, String> {
    let text = std::fs::read_to_string(module)
        .map_err(|error| format!("{}: {error}", module.display()))?;
    let count = text.split_once("[Channel; ").and_then(|(_, rest)| rest.split_once(']'));
    count
        .and_then(|(count, _)| count.parse().ok())
        .ok_or_else(|| format!("{}: has no number of channels", module.display()))
}

/// Image of a board, a program of the board's workspace.
pub struct Image {
    folder: &'static str,
    target: &'static str,
    /// Robot file for images that are not for a particular robot.
    robot: &'static str,
    /// Name of the program.
    pub name: &'static str,
}

/// Image of the emulated board with its buses and its time over the UART.
pub const MPS2_AN386: Image = Image {
    folder: "firmware/boards/mps2-an386",
    target: CORTEX_M4F,
    robot: AGILEBOT,
    name: "rollwalk-mps2-an386",
};
/// Image of the emulated board with requests and expected answers in its memory.
pub const MPS2_AN386_REPLAY: Image = Image {
    folder: "firmware/boards/mps2-an386",
    target: CORTEX_M4F,
    robot: AGILEBOT,
    name: "rollwalk-mps2-an386-replay",
};
/// Image of the emulated board with its link as an SLCAN adapter, in real time.
pub const MPS2_AN386_SLCAN: Image = Image {
    folder: "firmware/boards/mps2-an386",
    target: CORTEX_M4F,
    robot: AGILEBOT,
    name: "rollwalk-mps2-an386-slcan",
};
/// Image of the emulated board that measures the cost of keys.
pub const MPS2_AN386_KEYS: Image = Image {
    folder: "firmware/boards/mps2-an386",
    target: CORTEX_M4F,
    robot: AGILEBOT,
    name: "rollwalk-mps2-an386-keys",
};
/// RAM of the emulated board's images (`memory.x`); higher addresses represent external memory.
pub const RAM: Range<u64> = 0x2000_0000..0x2001_0000;
/// Image of the NUCLEO-G474RE.
pub const NUCLEO_G474RE: Image = Image {
    folder: "firmware/boards/nucleo-g474re",
    target: CORTEX_M4F,
    robot: AGILEBOT,
    name: "rollwalk-nucleo-g474re",
};
/// Image of the Pico 2, which has no CAN.
pub const PICO2: Image = Image {
    folder: "firmware/boards/pico2",
    target: CORTEX_M33F,
    robot: "shipped/robots/pup.toml",
    name: "rollwalk-pico2",
};

impl Image {
    /// Builds the image together with the others of its workspace, which are then linked in parallel.
    ///
    /// # Errors
    /// Returns an error if the build fails. If a compiler is missing, the error contains the command that installs it.
    pub fn build(&self, bench: &Bench) -> Result<PathBuf, String> {
        self.run(&["--bins"], &bench.shipped(self.robot)?)
    }

    /// Builds the image for the robot of a generated module, with the given cargo features for keys, or none if empty. The next
    /// build replaces the file.
    ///
    /// # Errors
    /// Returns the errors of [`Self::build`].
    pub fn build_for(&self, module: &Path, key_features: &str) -> Result<PathBuf, String> {
        let selection = ["--bin", self.name, "--features", key_features];
        let (mut cargo, path) = self.cargo(&selection, module)?;
        if !key_features.is_empty() {
            cargo.env("RUSTFLAGS", COMPACT_HASHES);
        }
        shell::run(&mut cargo)?;
        Ok(path)
    }

    /// Builds the image with a cargo feature; the next build without it replaces the file.
    ///
    /// # Errors
    /// Returns the errors of [`Self::build`].
    pub fn build_with(&self, bench: &Bench, feature: &str) -> Result<PathBuf, String> {
        self.run(&["--bin", self.name, "--features", feature], &bench.shipped(self.robot)?)
    }

    /// Builds the image with cargo features for keys; the next build without them replaces the file.
    ///
    /// # Errors
    /// Returns the errors of [`Self::build`].
    pub fn build_with_keys(&self, bench: &Bench, features: &str) -> Result<PathBuf, String> {
        self.build_for(&bench.shipped(self.robot)?, features)
    }

    fn run(&self, selection: &[&str], robot: &Path) -> Result<PathBuf, String> {
        let (mut cargo, path) = self.cargo(selection, robot)?;
        shell::run(&mut cargo)?;
        Ok(path)
    }

    /// Returns the build command and the path of the resulting file.
    fn cargo(&self, selection: &[&str], robot: &Path) -> Result<(Command, PathBuf), String> {
        let bare_metal::Build { mut cargo, artefacts } = bare_metal::build(self.target)?;
        cargo.current_dir(shell::workspace_root().join(self.folder)).arg("--quiet").args(selection);
        if channels(robot)? > FEW_CHANNELS {
            cargo.args(["--features", "many-channels"]);
        }
        cargo.env(ROBOT, robot);
        Ok((cargo, artefacts.join(self.name)))
    }
}
