//! Unsaved edits, kept from one start of the studio to the next. Each set of files has its own file in the user's state folder.

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
    /// Page that stored the edits: a random text of each page; empty if unknown.
    #[serde(default)]
    by: String,
}

/// Stored edits.
#[derive(Debug, Serialize)]
pub struct StoredEdits {
    /// Documents and history of the page.
    page: String,
    /// Page that stored the edits.
    by: String,
    /// True if the files are unchanged.
    is_current: bool,
}

/// Folder of the studio in the user's state folder; `None` if the user has no state folder.
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
        let EditsFile { digest: before, page, by, .. } = self.stored()?;
        Some(StoredEdits { page, by, is_current: before == digest })
    }

    /// Reads the stored edits of the open files.
    fn stored(&self) -> Option<EditsFile> {
        let is_short = fs::metadata(&self.place).is_ok_and(|found| found.len() <= BYTES_MAX);
        let text = is_short.then(|| fs::read_to_string(&self.place).ok()).flatten()?;
        let kept: EditsFile = serde_json::from_str(&text).ok()?;
        (kept.files == self.files).then_some(kept)
    }

    /// Stores a page's documents and history; `digest` is that of the current files.
    ///
    /// Page `by` may replace its own edits, and those of page `from`, which it opened. It does not replace those of a third
    /// page that was opened since.
    ///
    /// # Errors
    /// Returns an error if another page has stored edits since, if the text is too long, or if the operating system refuses.
    pub fn keep(&self, page: &str, [by, from]: [&str; 2], digest: u32) -> Result<(), String> {
        let failed =
            |why: String| format!("edits cannot be kept in {}: {why}", self.place.display());
        let before = self.stored().map_or(String::new(), |kept| kept.by);
        if !before.is_empty() && before != by && before != from {
            return Err("another tab has unsaved edits of these files: save your files in this \
                        tab, or close the other tab and reload this tab"
                .to_owned());
        }
        let (files, page, by) = (self.files.clone(), page.to_owned(), by.to_owned());
        let kept = EditsFile { files, digest, page, by };
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
