//! The file that keeps the library of a simulated controller while it is switched off.

use crate::signing;
use miette::{Report, miette};
use rollwalk_sim_host::store::{LIBRARY_MAX, VerifyingKey};
use rollwalk_terminal::files::{self, Output};
use rollwalk_terminal::output;
use rollwalk_terminal::packed::Packed;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Interval at which the controller's library is compared with the file.
const PERIOD: Duration = Duration::from_millis(100);

/// Library in the controller's flash, and the file that has it too.
pub struct Memory {
    path: PathBuf,
    output: Output,
    library: Option<Vec<u8>>,
    /// The file is as it was found: its user may have no other copy of it.
    found: bool,
    compared: Instant,
    /// Reason for which the last library could not be kept.
    failed: Option<Report>,
}

impl Memory {
    /// Reads the library, if there is one, and makes sure that another can be written. A controller without a key
    /// has no use for its signature, and gets the library alone, as `rollwalk flash` sends it.
    ///
    /// # Errors
    /// The library is for another robot, damaged or not signed with `key`; no file can be written there.
    pub fn open(path: &Path, robot: &Path, key: Option<&VerifyingKey>) -> miette::Result<Self> {
        // In this order: what has been read is no output for any other purpose.
        let output = Output::of_source(path)?;
        let found = path.exists();
        let packed = found.then(|| Packed::read(path, Some(robot))).transpose()?;
        if let (Some(packed), Some(key)) = (&packed, key)
            && let Err(why) = signing::check(&packed.file, key)
        {
            let help = "`rollwalk library sign` signs it; or name a file that is not there yet, and flash a signed library";
            return Err(miette!(help = help, "{} {why}", path.display()));
        }
        let library = packed.map(|packed| match key {
            Some(_) => packed.file,
            None => packed.library().bytes().to_vec(),
        });
        if let Some(bytes) = library.as_ref().map(Vec::len).filter(|bytes| *bytes > LIBRARY_MAX) {
            return Err(miette!(
                "{} has {bytes} bytes; the memory of a simulated controller has {LIBRARY_MAX}",
                path.display()
            ));
        }
        let (path, compared) = (path.to_owned(), Instant::now());
        Ok(Self { path, output, library, found, compared, failed: None })
    }

    /// The library that the file has, with its signature if the controller checks it.
    pub fn library(&self) -> Option<&[u8]> {
        self.library.as_deref()
    }

    /// Keeps a library that has become active, before its host has an answer; returns whether it is on the disk. [`watch`](Self::watch)
    /// returns the reason if it is not.
    pub fn keep_first(&mut self, library: &[u8]) -> bool {
        self.failed = self.keep(Some(library)).err();
        self.failed.is_none()
    }

    /// Compares the controller's library with the file's, now and then, and keeps another one.
    ///
    /// # Errors
    /// As [`keep`](Self::keep).
    pub fn watch(&mut self, library: Option<&[u8]>) -> miette::Result<()> {
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        if self.compared.elapsed() < PERIOD {
            return Ok(());
        }
        self.compared = Instant::now();
        self.keep(library)
    }

    /// Keeps the controller's library. The one that was found goes to a file of its own.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn keep(&mut self, library: Option<&[u8]>) -> miette::Result<()> {
        let Some(library) = library.filter(|library| self.library() != Some(library)) else {
            return Ok(());
        };
        let before = std::mem::take(&mut self.found).then(|| self.put_aside()).transpose()?;
        self.output.write(library)?;
        self.library = Some(library.to_vec());
        let before = before.map(|path| format!("; the one before is in {}", path.display()));
        output::say(format_args!(
            "{} has the library that was flashed{}",
            self.path.display(),
            before.unwrap_or_default()
        ));
        Ok(())
    }

    fn put_aside(&self) -> miette::Result<PathBuf> {
        let target = self.output.target();
        let mut names = (2..).map(|number| files::numbered(target, number));
        let free = names.find(|path| !path.exists()).unwrap_or_default();
        files::write(&free, self.library.as_deref().unwrap_or_default())?;
        Ok(free)
    }
}
