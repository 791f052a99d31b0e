//! Journals of work in units: a line for the work, then a line for every finished unit. Written lines are not lost, and an
//! incomplete final line of an interrupted run is ignored.

use miette::{IntoDiagnostic, miette};
use rollwalk_terminal::files::cannot_write;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// First line of a journal, which identifies the work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Name of the work.
    pub work: String,
    /// Digest of all inputs that the results depend on.
    pub digest: String,
    /// Version of the program, because other versions may compute other results.
    pub version: String,
    pub units: usize,
}

/// Finished unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unit<R> {
    pub unit: usize,
    /// Result of the unit.
    pub result: R,
}

/// Contents of a journal.
struct JournalContents<R> {
    header: Header,
    results: BTreeMap<usize, R>,
    /// Total length of the valid lines before the first invalid one, bytes.
    whole: usize,
}

/// Formats a line of a journal.
fn line(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("results become JSON") + "\n"
}

/// Parses a journal; `None` if its first line is not a header.
fn parse<R: DeserializeOwned>(text: &str) -> Option<JournalContents<R>> {
    let mut lines = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
    let first = lines.next()?;
    let header: Header = serde_json::from_str(first).ok()?;
    let units = header.units;
    let mut read = JournalContents { header, results: BTreeMap::new(), whole: first.len() };
    for line in lines {
        let Ok(Unit { unit, result }) = serde_json::from_str(line) else { break };
        if unit >= units {
            break;
        }
        read.results.insert(unit, result);
        read.whole += line.len();
    }
    Some(read)
}

/// Journals of some work in a folder: `NAME.journal.jsonl`, `NAME.journal-2-of-5.jsonl`.
pub struct Journals<'a> {
    pub folder: &'a Path,
    /// Start of the file names.
    pub name: &'a str,
    /// Header that all journals of this work must have.
    pub header: Header,
}

impl Journals<'_> {
    /// Path of the journal of a shard.
    pub fn path(&self, [k, n]: [usize; 2]) -> PathBuf {
        let part = if n == 1 { String::new() } else { format!("-{k}-of-{n}") };
        self.folder.join(format!("{}.journal{part}.jsonl", self.name))
    }

    /// Reads the results from all journals.
    ///
    /// # Errors
    /// Returns an error if a journal belongs to other work, or if a file cannot be read.
    pub fn results<R: DeserializeOwned>(&self) -> miette::Result<BTreeMap<usize, R>> {
        let start = format!("{}.journal", self.name);
        let mut results = BTreeMap::new();
        for entry in fs::read_dir(self.folder).into_diagnostic()? {
            let path = entry.into_diagnostic()?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.starts_with(&start)
                && name.ends_with(".jsonl")
                && let Some(read) = self.read(&path)?
            {
                results.extend(read.results);
            }
        }
        Ok(results)
    }

    /// Reads a journal of this work; `None` if the file ends within its first line.
    fn read<R: DeserializeOwned>(&self, path: &Path) -> miette::Result<Option<JournalContents<R>>> {
        let text = fs::read_to_string(path)
            .map_err(|error| miette!("cannot read {}: {error}", path.display()))?;
        if !text.contains('\n') {
            return Ok(None);
        }
        match parse(&text) {
            Some(read) if read.header == self.header => Ok(Some(read)),
            Some(JournalContents { header, .. }) => Err(miette!(
                help = "give another folder, or remove the journals in this folder",
                "{} is the journal of another run, {} of version {}: {}",
                path.display(),
                header.work,
                header.version,
                if header.work != self.header.work {
                    format!("this is {}", self.header.work)
                } else if header.version != self.header.version {
                    format!("this is version {}", self.header.version)
                } else {
                    "a file or an option of the work has changed since".to_owned()
                }
            )),
            None => Err(miette!(
                help = "remove the file, or give another folder",
                "{} is not a journal",
                path.display()
            )),
        }
    }

    /// Opens the journal of a shard for appending, and truncates it after its final valid result.
    ///
    /// # Errors
    /// Returns an error if the journal belongs to other work, or if the file cannot be opened.
    pub fn open<R: DeserializeOwned>(&self, part: [usize; 2]) -> miette::Result<OpenJournal> {
        let path = self.path(part);
        let refused = |error| cannot_write(&path, error);
        let before = if path.exists() { self.read::<R>(&path)? } else { None };
        let file = OpenOptions::new().create(true).append(true).open(&path).map_err(refused)?;
        match before {
            Some(read) => file.set_len(read.whole as u64).map_err(refused)?,
            None => {
                file.set_len(0).map_err(refused)?;
                (&file).write_all(line(&self.header).as_bytes()).map_err(refused)?;
            }
        }
        Ok(OpenJournal { file, path })
    }
}

/// Journal that is open for appending.
pub struct OpenJournal {
    file: File,
    path: PathBuf,
}

impl OpenJournal {
    /// Appends a unit, and waits until it is on the disk.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn add<R: Serialize>(&mut self, unit: &Unit<R>) -> miette::Result<()> {
        let written = self.file.write_all(line(unit).as_bytes());
        written
            .and_then(|()| self.file.sync_data())
            .map_err(|error| cannot_write(&self.path, error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        Header { work: "w".into(), digest: "d".into(), version: "1".into(), units: 3 }
    }

    #[test]
    fn what_is_whole_is_kept_and_a_torn_line_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let journals = |header| Journals { folder: folder.path(), name: "w", header };
        let results = || journals(header()).results::<f64>().unwrap();
        let mut open = journals(header()).open::<f64>([1, 2]).unwrap();
        open.add(&Unit { unit: 2, result: 0.1 + 0.2 }).unwrap();
        open.add(&Unit { unit: 0, result: 1.0 }).unwrap();
        // Equal to the bit.
        assert_eq!(results(), BTreeMap::from([(0, 1.0), (2, 0.1 + 0.2)]));
        let path = folder.path().join("w.journal-1-of-2.jsonl");
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, &text[..text.len() - 4]).unwrap();
        assert_eq!(results(), BTreeMap::from([(2, 0.1 + 0.2)]));
        journals(header())
            .open::<f64>([1, 2])
            .unwrap()
            .add(&Unit { unit: 0, result: 1.0 })
            .unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
        // A journal also overwrites lines of another shape, and lines of units that do not exist.
        for foreign in [r#"{"unit":0,"result":"x"}"#, r#"{"unit":3,"result":1.0}"#] {
            fs::write(&path, text.replace(r#"{"unit":0,"result":1.0}"#, foreign)).unwrap();
            assert_eq!(results().len(), 1, "{foreign}");
            let mut open = journals(header()).open::<f64>([1, 2]).unwrap();
            open.add(&Unit { unit: 0, result: 1.0 }).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        // A journal with another name, and a journal that ends within its first line.
        fs::write(folder.path().join("x.journal.jsonl"), "{}\n").unwrap();
        fs::write(folder.path().join("w.journal-2-of-2.jsonl"), "{\"wor").unwrap();
        assert_eq!(results().len(), 2);
        let refused = |header| journals(header).results::<f64>().unwrap_err().to_string();
        let other = refused(Header { work: "v".into(), ..header() });
        assert!(other.contains("of another run, w") && other.contains("this is v"), "{other}");
        let changed = refused(Header { digest: "e".into(), ..header() });
        assert!(changed.contains("has changed since"), "{changed}");
        fs::write(&path, "no journal\n").unwrap();
        assert!(refused(header()).contains("is not a journal"));
    }
}
