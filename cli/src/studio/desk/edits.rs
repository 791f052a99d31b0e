//! Unsaved edits, kept from one start of the studio to the next. Each set of files has its own file in the user's state.

use directories::ProjectDirs;
use rollwalk_protocol::crc::file_digest;
use rollwalk_terminal::files;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Maximum size of the stored edits, bytes: documents with their history.
const BYTES_MAX: u64 = 16 << 20;

/// Edits of a set of files, and the path of the file that stores them.
pub struct Edits {
    place: PathBuf,
    files: Vec<PathBuf>,
}

/// Content of the file with the edits.
#[derive(Serialize, Deserialize)]
struct EditsFile {
    /// Absolute paths of the opened files.
    files: Vec<PathBuf>,
    /// Digest of the opened files when the edits were stored.
    digest: u32,
    /// Documents and history, in the format of the page.
    page: String,
}

/// Stored edits.
#[derive(Debug, Serialize)]
pub struct StoredEdits {
    /// Documents and history of the page.
    page: String,
    /// True if the files are unchanged.
    is_current: bool,
}

/// Folder in the user's state; `None` if the user has no state folder.
pub fn folder() -> Option<PathBuf> {
    let folders = ProjectDirs::from("", "", "rollwalk")?;
    Some(folders.state_dir().unwrap_or(folders.data_local_dir()).join("studio"))
}

impl Edits {
    /// Edits of the files that the user named; an empty list stands for the shipped files.
    pub fn of(paths: &[PathBuf], folder: &Path) -> Self {
        let here = env::current_dir().unwrap_or_default();
        let whole = |path: &PathBuf| fs::canonicalize(path).unwrap_or_else(|_| here.join(path));
        let files: Vec<PathBuf> = paths.iter().map(whole).collect();
        let name = file_digest(format!("{files:?}").as_bytes());
        Self { place: folder.join(format!("{name:08x}.json")), files }
    }

    /// Reads the edits that the page stored most recently; `digest` is that of the current files.
    pub fn kept(&self, digest: u32) -> Option<StoredEdits> {
        let is_short = fs::metadata(&self.place).is_ok_and(|found| found.len() <= BYTES_MAX);
        let text = is_short.then(|| fs::read_to_string(&self.place).ok()).flatten()?;
        let kept: EditsFile = serde_json::from_str(&text).ok()?;
        let is_current = kept.digest == digest;
        (kept.files == self.files).then_some(StoredEdits { page: kept.page, is_current })
    }

    /// Stores the page's documents and history; `digest` is that of the current files.
    ///
    /// # Errors
    /// Returns an error if the text is too long, or if the operating system refuses.
    pub fn keep(&self, page: &str, digest: u32) -> Result<(), String> {
        let failed =
            |why: String| format!("edits cannot be kept in {}: {why}", self.place.display());
        let kept = EditsFile { files: self.files.clone(), digest, page: page.to_owned() };
        let text = serde_json::to_string(&kept).map_err(|why| failed(why.to_string()))?;
        if text.len() as u64 > BYTES_MAX {
            return Err(failed(format!(
                "{} bytes exceed the limit of {BYTES_MAX} bytes",
                text.len()
            )));
        }
        let folder = self.place.parent().map_or(Ok(()), fs::create_dir_all);
        folder.map_err(|why| failed(why.to_string()))?;
        files::write(&self.place, text.as_bytes()).map_err(|why| failed(why.to_string()))
    }
}
