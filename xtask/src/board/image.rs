//! The release image of the board.

use crate::{bare_metal, shell};
use std::path::PathBuf;

const FOLDER: &str = "firmware/boards/mps2-an386";
const NAME: &str = "rollwalk-mps2-an386";

/// Builds the image with cargo features.
///
/// # Errors
/// The compiler's verdict, or the one command that gets a compiler.
pub fn build(features: &[&str]) -> Result<PathBuf, String> {
    let bare_metal::Build { mut cargo, artefacts } = bare_metal::build()?;
    cargo.current_dir(shell::workspace_root().join(FOLDER)).arg("--locked").arg("--quiet");
    if !features.is_empty() {
        cargo.args(["--features", &features.join(",")]);
    }
    shell::run(&mut cargo)?;
    Ok(artefacts.join(NAME))
}
