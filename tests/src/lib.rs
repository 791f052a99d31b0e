//! Support for the end-to-end tests in `integration/`: a working folder, and a command line that runs in it as for a user.

mod kept;
pub mod program;
pub mod terminal;

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::OnceLock;
use tempfile::TempDir;

/// Sends a signal to a program, such as `INT` for Ctrl-C.
///
/// # Panics
/// Panics if the program no longer exists.
#[track_caller]
pub fn signal(program: &Child, name: &str) {
    let mut kill = Command::new("kill");
    kill.args([format!("-{name}"), program.id().to_string()]);
    assert!(kill.status().expect("kill").success(), "kill -{name}");
}

/// Temporary folder in which commands run.
pub struct Desk {
    folder: TempDir,
    binary: PathBuf,
}

/// Outcome of a command.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Exit code; -1 if a signal ended the command.
    pub code: i32,
    /// Standard output: the results.
    pub stdout: String,
    /// Error output: messages.
    pub stderr: String,
}

impl Desk {
    /// Creates an empty folder in which `binary` will run.
    pub fn new(binary: &str) -> Self {
        let folder = tempfile::tempdir().expect("temporary folder");
        Self { folder, binary: binary.into() }
    }

    /// Creates an empty folder in which `rollwalk` will run. Its benchmark program `bench` is in the same folder as `rollwalk`,
    /// as in an installation.
    pub fn with_programs(rollwalk: &str, bench: &str) -> Self {
        static FOLDER: OnceLock<PathBuf> = OnceLock::new();
        let folder = FOLDER.get_or_init(|| {
            // On the file system of the programs, because hard links are needed.
            let folder = Path::new(rollwalk).with_file_name("beside-each-other");
            fs::create_dir_all(&folder).expect("a folder beside the programs");
            for (program, name) in [(rollwalk, "rollwalk"), (bench, "rollwalk-bench")] {
                // Other runs of the tests may use the present file.
                let new = folder.join(format!("{name}.{}", std::process::id()));
                fs::hard_link(program, &new).expect("a link to a program");
                fs::rename(&new, folder.join(name)).expect("a link in place of an older one");
                let _ = fs::remove_file(new);
            }
            folder
        });
        Self::new(&folder.join("rollwalk").to_string_lossy())
    }

    /// Path of a file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file into the folder.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path(name);
        let folder = path.parent().expect("a file lies in a folder");
        fs::create_dir_all(folder).expect("folder in the temporary folder");
        fs::write(path, content).expect("file in the temporary folder");
    }

    /// Reads the bytes of a file in the folder.
    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Reads the text of a file in the folder.
    pub fn read_text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Replaces the first `from` in a file of the folder by `to`.
    pub fn edit(&self, name: &str, from: &str, to: &str) {
        let text = self.read_text(name);
        assert!(text.contains(from), "{name} has no {from:?} to replace");
        self.write(name, text.replacen(from, to, 1));
    }

    /// Copies a folder with its subfolders into the folder `name`.
    pub fn copy_folder(&self, from: &Path, name: &str) {
        fs::create_dir_all(self.path(name)).expect("folder in the temporary folder");
        let entries = fs::read_dir(from).unwrap_or_else(|e| panic!("{}: {e}", from.display()));
        for entry in entries {
            let path = entry.expect("folder entry").path();
            let file = path.file_name().expect("a file has a name").to_string_lossy().into_owned();
            if path.is_dir() {
                self.copy_folder(&path, &format!("{name}/{file}"));
            } else {
                fs::copy(&path, self.path(name).join(file)).expect("copy of a file");
            }
        }
    }

    /// Creates the command with `args` without starting it.
    pub fn command<S: AsRef<OsStr>>(&self, args: &[S]) -> Command {
        let mut command = Command::new(&self.binary);
        command.args(args).current_dir(self.folder.path());
        // Reports wrap to the terminal's width; this one keeps every message on one line.
        command.env("COLUMNS", "1000").env("NO_COLOR", "1");
        command
    }

    /// Runs the command with `args` to its end.
    #[track_caller]
    pub fn run<S: AsRef<OsStr>>(&self, args: &[S]) -> Outcome {
        program::run(&mut self.command(args), program::PLANNED)
    }
}

impl Outcome {
    /// Asserts success and returns the results.
    #[track_caller]
    pub fn succeeds(self) -> String {
        assert_eq!(self.code, 0, "exit code; stdout:\n{}\nstderr:\n{}", self.stdout, self.stderr);
        self.stdout
    }

    /// Asserts the given exit code, and that the results contain all `words`.
    #[track_caller]
    pub fn succeeds_with(self, code: i32, words: &[&str]) {
        let Self { code: found, stdout, stderr } = self;
        assert_eq!(found, code, "exit code; stdout:\n{stdout}\nstderr:\n{stderr}");
        for word in words {
            assert!(stdout.contains(word), "the results lack {word:?}:\n{stdout}");
        }
    }

    /// Asserts the given exit code, empty results, and a message that contains all `words`.
    #[track_caller]
    pub fn fails(self, code: i32, words: &[&str]) {
        assert_eq!(
            self.code, code,
            "exit code; stdout:\n{}\nstderr:\n{}",
            self.stdout, self.stderr
        );
        assert_eq!(self.stdout, "", "a failing command prints no results");
        // Reports break lines and frame them; the words in their order are what matters.
        let flat = |text: &str| {
            let plain = text.replace(['│', '╰', '─', '▶', '×'], " ");
            plain.split_whitespace().collect::<Vec<_>>().join(" ")
        };
        let message = flat(&self.stderr);
        for word in words {
            assert!(message.contains(&flat(word)), "the message lacks {word:?}:\n{}", self.stderr);
        }
    }
}

/// Root of the checkout, with the shipped robots and motions.
pub fn checkout() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests lie in the checkout")
}
