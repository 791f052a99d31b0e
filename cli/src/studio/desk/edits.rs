//! Edits that the user has not saved yet, kept from one start of the studio to the next: a file of the user's state for each set of files.

use directories::ProjectDirs;
use rollwalk_protocol::crc::file_digest;
use rollwalk_terminal::files;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Most bytes of what is kept: documents with their history.
const BYTES_MAX: u64 = 16 << 20;

/// Where edits of some files are kept.
pub struct Edits {
    place: PathBuf,
    files: Vec<PathBuf>,
}

/// The file of the edits.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// Absolute paths of the files that were opened.
    files: Vec<PathBuf>,
    /// What the page wants to have back.
    page: String,
}

/// The folder of the user's state; `None` where the user has none.
pub fn folder() -> Option<PathBuf> {
    let folders = ProjectDirs::from("", "", "rollwalk")?;
    Some(folders.state_dir().unwrap_or(folders.data_local_dir()).join("studio"))
}

impl Edits {
    /// Edits of the files that the user named; without files, of those that ship.
    pub fn of(paths: &[PathBuf], folder: &Path) -> Self {
        let here = env::current_dir().unwrap_or_default();
        let whole = |path: &PathBuf| fs::canonicalize(path).unwrap_or_else(|_| here.join(path));
        let files: Vec<PathBuf> = paths.iter().map(whole).collect();
        let name = file_digest(format!("{files:?}").as_bytes());
        Self { place: folder.join(format!("{name:08x}.json")), files }
    }

    /// What the page kept last.
    pub fn kept(&self) -> Option<String> {
        let is_short = fs::metadata(&self.place).is_ok_and(|found| found.len() <= BYTES_MAX);
        let text = is_short.then(|| fs::read_to_string(&self.place).ok()).flatten()?;
        let Kept { files, page } = serde_json::from_str(&text).ok()?;
        (files == self.files).then_some(page)
    }

    /// Keeps what the page wants to have back.
    ///
    /// # Errors
    /// It is too long, or the operating system refuses.
    pub fn keep(&self, page: &str) -> Result<(), String> {
        let failed =
            |why: String| format!("edits cannot be kept in {}: {why}", self.place.display());
        let kept = Kept { files: self.files.clone(), page: page.to_owned() };
        let text = serde_json::to_string(&kept).map_err(|why| failed(why.to_string()))?;
        if text.len() as u64 > BYTES_MAX {
            return Err(failed(format!("{} bytes are more than {BYTES_MAX}", text.len())));
        }
        let folder = self.place.parent().map_or(Ok(()), fs::create_dir_all);
        folder.map_err(|why| failed(why.to_string()))?;
        files::write(&self.place, text.as_bytes()).map_err(|why| failed(why.to_string()))
    }
}
