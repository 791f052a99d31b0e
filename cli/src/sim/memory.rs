//! File that stores the library of a simulated controller between runs.

use crate::signing;
use miette::{Report, miette};
use rollwalk_sim_host::store::{LIBRARY_MAX, VerifyingKey};
use rollwalk_terminal::files::{self, Output};
use rollwalk_terminal::output;
use rollwalk_terminal::validated_library::ValidatedLibrary;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Interval at which the controller's library is compared with the file.
const PERIOD: Duration = Duration::from_millis(100);

/// Library in the controller's flash, and the file with its copy.
pub struct Memory {
    path: PathBuf,
    output: Output,
    library: Option<Vec<u8>>,
    /// True until the file found at the start is overwritten. The user may have no other copy of it.
    found: bool,
    compared: Instant,
    /// Reason why the most recent library could not be stored.
    failed: Option<Report>,
}

impl Memory {
    /// Reads the library, if there is one, and checks that another can be written. For a controller without a key the signature
    /// is removed, as in `rollwalk flash`.
    ///
    /// # Errors
    /// Returns an error if the library is for another robot, is damaged, is too large or is not signed with `key`, or if the file
    /// cannot be written.
    pub fn open(path: &Path, robot: &Path, key: Option<&VerifyingKey>) -> miette::Result<Self> {
        // This order guarantees that a file that was read is not used for another output.
        let output = Output::of_source(path)?;
        let found = path.exists();
        let other_robot =
            "start rollwalk-sim with the robot file of the library, or give another --library file";
        let packed =
            found.then(|| ValidatedLibrary::of_robot(path, robot, other_robot)).transpose()?;
        if let (Some(packed), Some(key)) = (&packed, key)
            && let Err(why) = signing::check(&packed.file, key)
        {
            let help = "sign the library with `rollwalk library sign`, or give a file that does \
                not exist yet and flash a signed library";
            return Err(miette!(help = help, "{} {why}", path.display()));
        }
        let library = packed.map(|packed| match key {
            Some(_) => packed.file,
            None => packed.library().bytes().to_vec(),
        });
        if let Some(bytes) = library.as_ref().map(Vec::len).filter(|bytes| *bytes > LIBRARY_MAX) {
            return Err(miette!(
                "{} has {bytes} bytes, but the memory of a simulated controller has {LIBRARY_MAX} \
                 bytes",
                path.display()
            ));
        }
        let (path, compared) = (path.to_owned(), Instant::now());
        Ok(Self { path, output, library, found, compared, failed: None })
    }

    /// Library of the file, with its signature if the controller checks it.
    pub fn library(&self) -> Option<&[u8]> {
        self.library.as_deref()
    }

    /// Stores a library that has become active, before the host receives an answer. Returns true on success; after a failure
    /// [`watch`](Self::watch) returns the reason.
    pub fn keep_first(&mut self, library: &[u8]) -> bool {
        self.failed = self.keep(Some(library)).err();
        self.failed.is_none()
    }

    /// Periodically compares the controller's library with the file, and stores a new one.
    ///
    /// # Errors
    /// Returns the errors of [`keep`](Self::keep).
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

    /// Stores the controller's library. The library found at the start is copied to another file first.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn keep(&mut self, library: Option<&[u8]>) -> miette::Result<()> {
        let Some(library) = library.filter(|library| self.library() != Some(library)) else {
            return Ok(());
        };
        let before = std::mem::take(&mut self.found).then(|| self.put_aside()).transpose()?;
        self.output.write(library)?;
        self.library = Some(library.to_vec());
        let before = before.map(|path| format!("; the previous library is in {}", path.display()));
        output::print_line(format_args!(
            "{} now contains the flashed library{}",
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
