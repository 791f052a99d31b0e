//! Files that the studio opened, and the files that they name: read at the start, written when the user saves.
//!
//! Nothing else is read or written. Files may be untrusted. A file that another file names is opened only if it is a document
//! or plan of Rollwalk, and written only in the folder of a file that the user named, or below. A file that another program has
//! changed meanwhile is not overwritten.

mod edits;
mod opening;

use edits::Edits;
pub use edits::folder;
use opening::{InitialFiles, Sheet};
use rollwalk_protocol::crc::file_digest_append;
use rollwalk_terminal::files;
use rollwalk_terminal::kind::Kind;
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Open files of the studio.
pub struct Desk {
    sheets: Mutex<Vec<Sheet>>,
    desired: InitialFiles,
    edits: Option<Edits>,
}

impl Desk {
    /// Opens files and all files that they name. Unsaved edits of them are kept in `folder`, which is in the user's state folder.
    ///
    /// # Errors
    /// Returns an error if a file that the user named cannot be read, or is of a kind that the studio does not open, or if the
    /// motion of a plan is not found.
    pub fn open(paths: &[PathBuf], folder: Option<PathBuf>) -> miette::Result<Self> {
        let (sheets, desired) = opening::open(paths)?;
        let edits = folder.map(|folder| Edits::of(paths, &folder));
        Ok(Self { sheets: Mutex::new(sheets), desired, edits })
    }

    /// Answers a request about files; returns `None` for requests to the engine.
    pub fn answer(&self, request: &str) -> Option<Value> {
        let request: Value = serde_json::from_str(request).ok()?;
        let seq = &request["seq"];
        match request["kind"].as_str()? {
            "given" => {
                let file = |sheet: &Sheet| json!({ "path": sheet.name, "text": sheet.text });
                let sheets = self.sheets();
                let files: Vec<_> = sheets.iter().map(file).collect();
                let edits = self.edits.as_ref().and_then(|edits| edits.kept(digest(&sheets)));
                Some(json!({
                    "seq": seq, "binary": false, "kind": "done", "files": files, "desired": self.desired, "edits": edits,
                }))
            }
            "keep" => {
                let [text, by, from] =
                    ["text", "by", "from"].map(|key| request[key].as_str().unwrap_or_default());
                // The lock lasts until the edits are stored, so that two pages cannot store edits at the same time.
                let sheets = self.sheets();
                let digest = digest(&sheets);
                let edits = self.edits.as_ref();
                let kept =
                    edits.map_or(Err(no_folder()), |edits| edits.keep(text, [by, from], digest));
                Some(match kept {
                    Ok(()) => json!({ "seq": seq, "binary": false, "kind": "done" }),
                    Err(message) => json!({
                        "seq": seq, "binary": false, "kind": "error", "message": message, "help": "save your files",
                    }),
                })
            }
            "save" => {
                let [path, text] =
                    ["path", "text"].map(|key| request[key].as_str().unwrap_or_default());
                Some(match self.save(path, text) {
                    Ok(()) => json!({ "seq": seq, "binary": false, "kind": "done" }),
                    Err((message, help)) => json!({
                        "seq": seq, "binary": false, "kind": "error", "message": message, "help": help,
                    }),
                })
            }
            _ => None,
        }
    }

    /// Writes an open file.
    fn save(&self, name: &str, text: &str) -> Result<(), (String, &'static str)> {
        let mut sheets = self.sheets();
        let Some(sheet) = sheets.iter_mut().find(|sheet| sheet.name == name) else {
            let help = "save a copy from the page, or start `rollwalk studio` with the file";
            return Err((
                format!("`{name}` is not among the files that the studio was opened with"),
                help,
            ));
        };
        if !sheet.is_users {
            let help = "save a copy from the page, or start `rollwalk studio` with this file, too";
            return Err((
                format!(
                    "`{name}` is named in an open file, but was not given to `rollwalk studio`"
                ),
                help,
            ));
        }
        if text.len() as u64 > Kind::Motion.max_bytes() {
            return Err((
                format!("`{name}` would have {} bytes, more than 1 MiB", text.len()),
                "shorten the file",
            ));
        }
        if fs::read_to_string(&sheet.path).is_ok_and(|now| now != sheet.text) {
            let help = "save a copy from the page, and open the studio again";
            return Err((
                format!("`{name}` has been changed by another program since it was opened"),
                help,
            ));
        }
        let written = files::save(&sheet.path, text.as_bytes());
        written.map_err(|error| (format!("{error:#}"), "save a copy from the page"))?;
        sheet.text = text.to_owned();
        Ok(())
    }

    fn sheets(&self) -> MutexGuard<'_, Vec<Sheet>> {
        self.sheets.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Digest of the files as they were most recently read or written.
fn digest(sheets: &[Sheet]) -> u32 {
    sheets.iter().fold(0, |before, sheet| {
        let named = file_digest_append(before, sheet.name.as_bytes());
        file_digest_append(named, sheet.text.as_bytes())
    })
}

fn no_folder() -> String {
    "unsaved edits cannot be kept without a state folder: set HOME or XDG_STATE_HOME".to_owned()
}
