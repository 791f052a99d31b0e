//! Files that grow during a run. A full file is followed by another, and the oldest files are removed.

use super::{Output, cannot_write, folder, numbered};
use crate::output;
use std::collections::VecDeque;
use std::fmt::{self, Display};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::{Duration, Instant};

/// Interval at which a growing file is written to the disk, and so the maximum that a killed program loses.
const PERIOD: Duration = Duration::from_secs(1);

/// Size at which a file is followed by another, and number of files that are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rotation {
    /// Size of a full file, MB; `None` for no limit.
    megabytes: Option<u64>,
    /// Number of files that are kept.
    files: usize,
}

impl Rotation {
    /// Single file without a size limit.
    pub const OFF: Self = Self { megabytes: None, files: usize::MAX };
}

/// Forty files of 250 MB: twelve hours of a robot with twenty motors.
impl Default for Rotation {
    fn default() -> Self {
        Self { megabytes: Some(250), files: 40 }
    }
}

impl Display for Rotation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.megabytes {
            Some(megabytes) => write!(f, "{megabytes}x{}", self.files),
            None => f.write_str("off"),
        }
    }
}

impl FromStr for Rotation {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "off" {
            return Ok(Self::OFF);
        }
        let parts = text.split_once('x');
        let parts = parts.and_then(|(size, files)| Some((size.parse().ok()?, files.parse().ok()?)));
        match parts {
            Some((megabytes @ 1..=1_000_000, files @ 2..=10_000)) => {
                Ok(Self { megabytes: Some(megabytes), files })
            }
            _ => {
                Err("give MEGABYTESxFILES, such as 250x40 (1 to 1000000 MB, 2 to 10000 files), or \
                 `off`"
                    .into())
            }
        }
    }
}

/// Options of commands that write logs.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct RotationArgs {
    /// Size in MB at which a log is continued in a new file (run.log, run.2.log, ...), and number of files to keep; or off.
    #[arg(long, value_name = "MBxFILES", default_value_t)]
    pub rotate: Rotation,
}

/// Time of the previous write of a growing file to the disk.
struct Clock(Instant);

impl Clock {
    fn strikes(&mut self) -> bool {
        let strikes = self.0.elapsed() >= PERIOD;
        if strikes {
            self.0 = Instant::now();
        }
        strikes
    }
}

/// Files of a run, written one after the other. Existing files are never overwritten.
pub struct Series {
    /// First file, as the user named it.
    named: PathBuf,
    /// First file, with links followed.
    first: PathBuf,
    rotation: Rotation,
    /// Number of the current file.
    number: u32,
    /// Files of this run, oldest first; the current file is at the back.
    files: VecDeque<PathBuf>,
    /// Handle of the current file, for reading its size.
    file: File,
    clock: Clock,
    says: bool,
}

impl Series {
    /// Creates the file of `output`, and starts the series with it. The files of a previous recording of that name are renamed.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn begin(output: &Output, rotation: Rotation) -> miette::Result<(Self, BufWriter<File>)> {
        put_aside(output)?;
        let file = output.create()?;
        let series = Self {
            named: output.path().to_owned(),
            first: output.target().to_owned(),
            rotation,
            number: 1,
            files: VecDeque::from([output.target().to_owned()]),
            file: copy(output.path(), file.get_ref())?,
            clock: Clock(Instant::now()),
            says: true,
        };
        Ok((series, file))
    }

    /// True if it is time to flush. The caller then calls [`next_file`](Self::next_file).
    pub fn is_due(&mut self) -> bool {
        self.clock.strikes()
    }

    /// Starts the next file of the series if the current one has reached its size limit; returns `None` otherwise. Unflushed
    /// bytes are not counted.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn next_file(&mut self) -> miette::Result<Option<BufWriter<File>>> {
        let named = self.named.clone();
        let failed = |error| cannot_write(&named, error);
        let found = self.file.metadata().map_err(failed)?;
        // Devices and pipes have no size limit.
        let is_full = |megabytes: u64| found.is_file() && found.len() >= megabytes * 1_000_000;
        if !self.rotation.megabytes.is_some_and(is_full) {
            return Ok(None);
        }
        let (path, file) = self.make().map_err(failed)?;
        self.file = copy(&path, &file)?;
        self.files.push_back(path);
        while self.files.len() > self.rotation.files {
            let oldest = self.files.pop_front().unwrap_or_default();
            // Another program may have moved the file.
            if fs::remove_file(&oldest).is_ok() && std::mem::take(&mut self.says) {
                output::print_line(format_args!(
                    "removed {}, the oldest of {} files, because of the limit --rotate {}",
                    oldest.display(),
                    self.rotation.files + 1,
                    self.rotation
                ));
            }
        }
        Ok(Some(BufWriter::new(file)))
    }

    /// Creates a file with the next free number.
    fn make(&mut self) -> io::Result<(PathBuf, File)> {
        loop {
            self.number += 1;
            let path = numbered(&self.first, self.number);
            match File::create_new(&path) {
                Ok(file) => return Ok((path, file)),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }
}

/// Renames the files of a previous recording to a free common name, so that no recording is lost and its files stay in order:
/// `run.log` and `run.2.log` become `run-1.log` and `run-1.2.log`.
fn put_aside(output: &Output) -> miette::Result<()> {
    let target = output.target();
    let numbers = previous(target);
    let Some(&first) = numbers.first() else { return Ok(()) };
    let names = |copy: u32| -> Vec<_> {
        let aside = aside(target, copy);
        numbers.iter().map(|&number| of_series(&aside, number)).collect()
    };
    let is_free = |names: &Vec<PathBuf>| !names.iter().any(|path| path.exists());
    let names = (1..).map(names).find(is_free).unwrap_or_default();
    for (&number, name) in numbers.iter().zip(&names) {
        let renamed = fs::rename(of_series(target, number), name);
        renamed.map_err(|error| cannot_write(name, error))?;
    }
    let others = match names.len() {
        1 => String::new(),
        count => format!(", with {} later files", count - 1),
    };
    output::print_line(format_args!(
        "{} existed: the previous recording is now {}{others}",
        of_series(output.path(), first).display(),
        names[0].display()
    ));
    Ok(())
}

/// Numbers of the files of a previous recording, ascending. Files without content do not count.
fn previous(target: &Path) -> Vec<u32> {
    let beside = fs::read_dir(folder(target)).into_iter().flatten().flatten();
    let numbers = beside.filter_map(|entry| {
        let path = entry.path();
        let beyond_stem = Path::new(path.file_name()?).with_extension("");
        let ending = if target.extension().is_some() { &beyond_stem } else { &path };
        let number = ending.extension()?.to_str()?.parse().ok()?;
        let is_of_series = numbered(target, number).file_name() == path.file_name();
        is_of_series.then_some(number)
    });
    let has_content = |number: &u32| {
        let found = fs::metadata(of_series(target, *number));
        found.is_ok_and(|found| found.is_file() && found.len() > 0)
    };
    let numbers = numbers.filter(|number| *number >= 2).chain([1]).filter(has_content);
    let mut numbers: Vec<_> = numbers.collect();
    numbers.sort_unstable();
    numbers
}

/// Path of a file of a series, counted from 1.
fn of_series(first: &Path, number: u32) -> PathBuf {
    if number == 1 { first.to_owned() } else { numbered(first, number) }
}

/// First file of a series that is put aside: `run-1.log` for `run.log` and 1.
fn aside(first: &Path, copy: u32) -> PathBuf {
    let mut name = first.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{copy}"));
    if let Some(extension) = first.extension() {
        name.push(".");
        name.push(extension);
    }
    first.with_file_name(name)
}

fn copy(path: &Path, file: &File) -> miette::Result<File> {
    file.try_clone().map_err(|error| cannot_write(path, error))
}

/// Log that grows line by line.
pub struct Lines {
    path: PathBuf,
    series: Series,
    file: BufWriter<File>,
    /// First line of every file.
    heading: Option<String>,
}

impl Lines {
    /// Creates an empty log.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn create(output: &Output, rotation: Rotation) -> miette::Result<Self> {
        let (series, file) = Series::begin(output, rotation)?;
        Ok(Self { path: output.path().to_owned(), series, file, heading: None })
    }

    /// Creates a log whose files all begin with `heading`.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn with_heading(
        output: &Output,
        rotation: Rotation,
        heading: String,
    ) -> miette::Result<Self> {
        let mut lines = Self::create(output, rotation)?;
        lines.heading = Some(heading);
        lines.head()?;
        Ok(lines)
    }

    fn head(&mut self) -> miette::Result<()> {
        let Some(heading) = &self.heading else { return Ok(()) };
        writeln!(self.file, "{heading}").map_err(|error| cannot_write(&self.path, error))
    }

    /// Appends a line.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn push(&mut self, line: impl Display) -> miette::Result<()> {
        let written = writeln!(self.file, "{line}");
        written.map_err(|error| cannot_write(&self.path, error))?;
        self.keep()
    }

    /// Writes buffered lines to the file once a second, and starts the next file if this one is full.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn keep(&mut self) -> miette::Result<()> {
        if self.series.is_due() {
            self.flush()?;
            if let Some(next) = self.series.next_file()? {
                self.file = next;
                self.head()?;
            }
        }
        Ok(())
    }

    /// Writes buffered lines to the file.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn flush(&mut self) -> miette::Result<()> {
        self.file.flush().map_err(|error| cannot_write(&self.path, error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates a series in a folder, with a size limit of 1 MB.
    fn series(folder: &Path, files: usize) -> (Series, BufWriter<File>) {
        let output = Output::at(&folder.join("run.log")).unwrap();
        Series::begin(&output, Rotation { megabytes: Some(1), files }).unwrap()
    }

    /// Fills a file up to its size limit, and returns the next one.
    fn fill(series: &mut Series, mut file: BufWriter<File>, mark: u8) -> BufWriter<File> {
        file.write_all(&vec![mark; 999_999]).unwrap();
        file.flush().unwrap();
        assert!(series.next_file().unwrap().is_none());
        file.write_all(&[mark]).unwrap();
        file.flush().unwrap();
        series.next_file().unwrap().unwrap()
    }

    fn files(folder: &Path) -> Vec<(String, Option<u8>)> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| {
            let path = entry.unwrap().path();
            let first = fs::read(&path).unwrap().first().copied();
            (path.file_name().unwrap().to_str().unwrap().to_owned(), first)
        });
        let mut files: Vec<_> = entries.collect();
        files.sort();
        files
    }

    #[test]
    fn the_newest_files_stay_and_those_of_others() {
        let folder = tempfile::tempdir().unwrap();
        let (mut series, mut file) = series(folder.path(), 2);
        // Another program writes a file with a number of the series.
        fs::write(folder.path().join("run.3.log"), "x").unwrap();
        for mark in *b"abc" {
            file = fill(&mut series, file, mark);
        }
        drop(file);
        let (old, now) = (("run.4.log".into(), Some(b'c')), ("run.5.log".into(), None));
        assert_eq!(files(folder.path()), [("run.3.log".into(), Some(b'x')), old, now]);
    }

    #[test]
    fn the_files_of_a_previous_recording_stay_together_and_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        let found = || {
            let named = |(name, mark): (String, Option<u8>)| (name, mark.map(char::from));
            files(folder.path()).into_iter().map(named).collect::<Vec<_>>()
        };
        let file = |name: &str, mark: char| (name.to_owned(), Some(mark));
        let now = ("run.log".to_owned(), None);
        for (name, text) in [("run.log", "a"), ("run.2.log", "b"), ("run.10.log", "c")] {
            write(name, text);
        }
        let others = [
            file("run-1.9.log", 'z'),
            file("run.02.log", 'y'),
            file("run.2.mcap", 'x'),
            file("walk.2.log", 'w'),
        ];
        for (name, mark) in &others {
            write(name, &mark.unwrap().to_string());
        }
        drop(series(folder.path(), 2));
        let first = [file("run-1.10.log", 'c'), file("run-1.2.log", 'b')];
        let [z, y, x, w] = others;
        let kept = [&first[..], &[z, file("run-1.log", 'a'), y, x]].concat();
        assert_eq!(found(), [&kept[..], &[now.clone(), w.clone()]].concat());
        // Rotation removed the first file of the second recording, and an empty file holds nothing.
        write("run.7.log", "d");
        drop(series(folder.path(), 2));
        let second = file("run-1.7.log", 'd');
        let kept = [&first[..], &[second], &kept[2..]].concat();
        assert_eq!(found(), [&kept[..], &[now, w]].concat());
    }

    #[test]
    fn a_log_that_is_killed_has_lost_a_second() {
        let folder = tempfile::tempdir().unwrap();
        let output = Output::at(&folder.path().join("run.log")).unwrap();
        let mut lines = Lines::create(&output, Rotation::default()).unwrap();
        lines.push("one").unwrap();
        assert_eq!(fs::read(folder.path().join("run.log")).unwrap(), b"");
        lines.series.clock.0 -= PERIOD;
        lines.push("two").unwrap();
        // Lines after the failed line would be lost.
        assert_eq!(fs::read(folder.path().join("run.log")).unwrap(), b"one\ntwo\n");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_log_whose_end_the_disk_does_not_take_says_so() {
        let full = Output::at(Path::new("/dev/full")).unwrap();
        let mut lines = Lines::create(&full, Rotation::default()).unwrap();
        // The line waits in the buffer.
        lines.push("one").unwrap();
        let error = lines.flush().unwrap_err().to_string();
        assert!(error.starts_with("cannot write /dev/full: No space left"), "{error}");
    }

    #[test]
    fn rotations_are_read_as_they_are_shown() {
        for text in ["250x40", "1x2", "off"] {
            assert_eq!(text.parse::<Rotation>().unwrap().to_string(), text);
        }
        for wrong in ["", "250", "0x4", "10x1", "x", "1x2x3", "-1x3"] {
            wrong.parse::<Rotation>().expect_err(wrong);
        }
    }
}
