//! The files that the studio was opened with, and what they name: read at the start, written when the user saves.
//!
//! Nothing else is read, and nothing else is written. Files may be a stranger's: what they name is opened if it is a document of ours, and written
//! if it lies beside a file that the user named, or below. A file that another program has changed since is not overwritten.

use rollwalk_terminal::files::{self, Named};
use rollwalk_terminal::inputs::beside;
use rollwalk_terminal::kind::Kind;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use toml_edit::{Document, Item, TableLike};

/// Most files, those that others name included.
const FILES_MAX: usize = 200;

/// Files on the desk.
pub struct Desk {
    sheets: Mutex<Vec<Sheet>>,
    /// The motion file to begin with.
    motion: Option<String>,
    /// The library file to begin with.
    library: Option<String>,
}

/// A file as it was read or written last.
struct Sheet {
    /// How the page knows it.
    name: String,
    path: PathBuf,
    text: String,
    /// Whether the user named it, or a file beside or above it.
    is_users: bool,
}

impl Desk {
    /// Opens files with all that they name.
    ///
    /// # Errors
    /// A file that the user named cannot be read, or is none that the studio edits.
    pub fn open(paths: &[PathBuf]) -> miette::Result<Self> {
        let mut desk = Self { sheets: Mutex::default(), motion: None, library: None };
        let mut open: Vec<(PathBuf, Named)> =
            paths.iter().rev().map(|path| (path.clone(), Named::ByUser)).collect();
        let folders: Vec<_> = paths.iter().filter_map(|path| folder_of(path)).collect();
        let mut sheets: Vec<Sheet> = Vec::new();
        while let Some((path, named)) = open.pop() {
            let name = name_of(&path);
            if sheets.len() == FILES_MAX || sheets.iter().any(|sheet| sheet.name == name) {
                continue;
            }
            let text = match files::read_by(&path, named, |_| Kind::Motion) {
                Ok(read) => files::text(read, &path)?,
                Err(error) if named == Named::ByUser => return Err(error.into()),
                // The engine says what is missing, and who names it.
                Err(_) => continue,
            };
            match Kind::expect_document(&path, &text) {
                Err(error) if named == Named::ByUser => return Err(error),
                // Plans of libraries are no documents; whatever else a file names is none of the studio's business.
                Err(_) if Kind::of(&text) != Some(Kind::Plan) => continue,
                _ => {}
            }
            let Mentions { is_motion, is_library, files } = mentions(&text);
            if named == Named::ByUser {
                desk.motion = desk.motion.or_else(|| is_motion.then(|| name.clone()));
                desk.library = desk.library.or_else(|| is_library.then(|| name.clone()));
            }
            let files = files.iter().rev().map(|file| (beside(&path, file), Named::InFile));
            open.extend(files);
            let is_below = |folder: &PathBuf| {
                folder_of(&path).is_some_and(|of_file| of_file.starts_with(folder))
            };
            let is_users = named == Named::ByUser || folders.iter().any(is_below);
            sheets.push(Sheet { name, path, text, is_users });
        }
        desk.sheets = Mutex::new(sheets);
        Ok(desk)
    }

    /// The answer to a request that is about files; `None` for those of the engine.
    pub fn answer(&self, request: &str) -> Option<Value> {
        let request: Value = serde_json::from_str(request).ok()?;
        let seq = &request["seq"];
        match request["kind"].as_str()? {
            "given" => {
                let file = |sheet: &Sheet| json!({ "path": sheet.name, "text": sheet.text });
                let files: Vec<_> = self.sheets().iter().map(file).collect();
                let Self { motion, library, .. } = self;
                Some(json!({
                    "seq": seq, "binary": false, "kind": "done", "files": files, "motion": motion, "library": library,
                }))
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

    /// Writes a file that is on the desk.
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
                    "`{name}` lies elsewhere than the files that the studio was opened with, one of which names it"
                ),
                help,
            ));
        }
        if text.len() as u64 > Kind::Motion.max_bytes() {
            return Err((format!("`{name}` would have {} bytes", text.len()), "shorten it"));
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

/// Folder of a file, without links; `None` if it is not there.
fn folder_of(path: &Path) -> Option<PathBuf> {
    Some(fs::canonicalize(path).ok()?.parent()?.to_owned())
}

/// A path as pages know it, with `/` between folders.
fn name_of(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

/// What a file is, and which files it names.
#[derive(Default)]
struct Mentions {
    is_motion: bool,
    is_library: bool,
    files: Vec<String>,
}

fn mentions(text: &str) -> Mentions {
    let Ok(document) = Document::parse(text) else { return Mentions::default() };
    let root = document.as_table();
    let mut files: Vec<String> =
        root.get("robot").and_then(Item::as_str).map(str::to_owned).into_iter().collect();
    let tables = root.get("motion").and_then(Item::as_array_of_tables).into_iter().flatten();
    let tables = tables.map(|table| table as &dyn TableLike);
    let inline = root.get("motions").and_then(Item::as_array).into_iter().flatten();
    let inline = inline.filter_map(|value| Some(value.as_inline_table()? as &dyn TableLike));
    for table in tables.chain(inline) {
        let named = ["file", "plan"].into_iter().filter_map(|key| table.get(key)?.as_str());
        files.extend(named.map(str::to_owned));
    }
    let (is_motion, is_library) = (root.contains_key("footfalls"), root.contains_key("safe"));
    Mentions { is_motion, is_library, files }
}
