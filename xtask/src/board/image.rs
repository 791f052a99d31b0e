//! The release image of a board.

use crate::{bare_metal, shell};
use std::path::PathBuf;

/// An image of a board: a program of the board's workspace.
pub struct Image {
    folder: &'static str,
    name: &'static str,
}

/// The emulated board's.
pub const MPS2_AN386: Image =
    Image { folder: "firmware/boards/mps2-an386", name: "rollwalk-mps2-an386" };
/// The emulated board's with its link as an SLCAN adapter, in real time.
pub const MPS2_AN386_SLCAN: Image =
    Image { folder: "firmware/boards/mps2-an386", name: "rollwalk-mps2-an386-slcan" };
/// The real board's.
pub const NUCLEO_G474RE: Image =
    Image { folder: "firmware/boards/nucleo-g474re", name: "rollwalk-nucleo-g474re" };

impl Image {
    /// Builds the image with cargo features.
    ///
    /// # Errors
    /// The compiler's verdict, or the one command that gets a compiler.
    pub fn build(&self, features: &[&str]) -> Result<PathBuf, String> {
        let bare_metal::Build { mut cargo, artefacts } = bare_metal::build()?;
        cargo
            .current_dir(shell::workspace_root().join(self.folder))
            .args(["--quiet", "--bin", self.name]);
        if !features.is_empty() {
            cargo.args(["--features", &features.join(",")]);
        }
        shell::run(&mut cargo)?;
        Ok(artefacts.join(self.name))
    }
}
