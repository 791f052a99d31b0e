//! The release images of the boards.

use crate::{bare_metal, shell};
use std::path::PathBuf;

/// An image of a board: a program of the board's workspace.
pub struct Image {
    folder: &'static str,
    /// Name of the program.
    pub name: &'static str,
}

/// The emulated board's, its buses and its time over the UART.
pub const MPS2_AN386: Image =
    Image { folder: "firmware/boards/mps2-an386", name: "rollwalk-mps2-an386" };
/// The emulated board's with requests and expected answers in its memory.
pub const MPS2_AN386_REPLAY: Image =
    Image { folder: "firmware/boards/mps2-an386", name: "rollwalk-mps2-an386-replay" };
/// The emulated board's with its link as an SLCAN adapter, in real time.
pub const MPS2_AN386_SLCAN: Image =
    Image { folder: "firmware/boards/mps2-an386", name: "rollwalk-mps2-an386-slcan" };
/// The real board's.
pub const NUCLEO_G474RE: Image =
    Image { folder: "firmware/boards/nucleo-g474re", name: "rollwalk-nucleo-g474re" };

impl Image {
    /// Builds the image and the others of its workspace, whose links then run at the same time.
    ///
    /// # Errors
    /// The compiler's verdict, or the one command that gets a compiler.
    pub fn build(&self) -> Result<PathBuf, String> {
        self.run(&["--bins"])
    }

    /// Builds the image with a cargo feature; the next build without replaces the file.
    ///
    /// # Errors
    /// As for [`Self::build`].
    pub fn build_with(&self, feature: &str) -> Result<PathBuf, String> {
        self.run(&["--bin", self.name, "--features", feature])
    }

    fn run(&self, selection: &[&str]) -> Result<PathBuf, String> {
        let bare_metal::Build { mut cargo, artefacts } = bare_metal::build()?;
        cargo.current_dir(shell::workspace_root().join(self.folder)).arg("--quiet").args(selection);
        shell::run(&mut cargo)?;
        Ok(artefacts.join(self.name))
    }
}
