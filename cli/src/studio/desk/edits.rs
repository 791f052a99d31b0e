//! Edits that the user has not saved yet, kept from one start of the studio to the next: a file of the user's state for each
//! set of files.

use directories::ProjectDirs;
use rollwalk_protocol::crc::file_digest;
use rollwalk_terminal::files;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Most bytes of what is kept: documents with their history.
const BYTES_MAX: u64 = 16 << 20;

/// Edits of some files, and the file of the user's state that keeps them.
pub struct Edits {
    place: PathBuf,
    files: Vec<PathBuf>,
}

/// The file of the edits.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// Absolute paths of the files that were opened.
    files: Vec<PathBuf>,
    /// Digest of the files as they were then.
    digest: u32,
    /// Documents and history of the page, in its own form.
    page: String,
}

/// Edits that were kept.
#[derive(Debug, Serialize)]
pub struct Found {
    /// Documents and history of the page.
    page: String,
    /// True if the files are unchanged.
    is_current: bool,
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

    /// The edits that the page kept last; `digest` is that of the files as they are.
    pub fn kept(&self, digest: u32) -> Option<Found> {
        let is_short = fs::metadata(&self.place).is_ok_and(|found| found.len() <= BYTES_MAX);
        let text = is_short.then(|| fs::read_to_string(&self.place).ok()).flatten()?;
        let kept: Kept = serde_json::from_str(&text).ok()?;
        let is_current = kept.digest == digest;
        (kept.files == self.files).then_some(Found { page: kept.page, is_current })
    }

    /// Keeps the page's documents and history; `digest` is that of the files as they are.
    ///
    /// # Errors
    /// Text that is too long, or a refusal of the operating system.
    pub fn keep(&self, page: &str, digest: u32) -> Result<(), String> {
        let failed =
            |why: String| format!("edits cannot be kept in {}: {why}", self.place.display());
        let kept = Kept { files: self.files.clone(), digest, page: page.to_owned() };
        let text = serde_json::to_string(&kept).map_err(|why| failed(why.to_string()))?;
        if text.len() as u64 > BYTES_MAX {
            return Err(failed(format!("{} bytes are more than {BYTES_MAX}", text.len())));
        }
        let folder = self.place.parent().map_or(Ok(()), fs::create_dir_all);
        folder.map_err(|why| failed(why.to_string()))?;
        files::write(&self.place, text.as_bytes()).map_err(|why| failed(why.to_string()))
    }
}
