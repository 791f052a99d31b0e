//! Shipped programs: linked statically with musl, so that they run on every Linux of this processor architecture.

use crate::{bare_metal, debian, shell};
use object::Object;
use std::env;
use std::fs;
use std::path::{Path, PathBuf};

/// Target triple of the programs.
pub const TARGET: &str = "x86_64-unknown-linux-musl";
/// Build profile of the programs, in the root `Cargo.toml`.
pub const PROFILE: &str = "ship";
pub const PROGRAMS: [&str; 4] = ["rollwalk", "rollwalk-sim", APPS[0], APPS[1]];
/// Programs of separate packages, which generate their own manual pages and completions.
pub const APPS: [&str; 2] = ["rollwalk-bench", "rollwalk-ros2"];

/// Folder of the built programs.
pub struct Programs {
    /// Folder of cargo for the target and the profile.
    pub folder: PathBuf,
}

impl Programs {
    /// Path of one of the [`PROGRAMS`].
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }
}

/// Builds the programs below the target folder `target`.
///
/// # Errors
/// Returns an error if the build fails; its messages are printed on the terminal. Also returns an error if a program depends on
/// libraries of the machine, or contains the path of this checkout or of the home folder.
pub fn programs(target: &Path) -> Result<Programs, String> {
    bare_metal::need_target(TARGET)?;
    // Zstandard and LZ4, which compress MCAP files, are written in C.
    debian::need(&["musl-tools"]).map_err(|install| {
        format!("static programs require musl's compiler. On Debian:\n\n    {install}")
    })?;
    let mut build = shell::cargo(&["build", "--locked", "--package", "rollwalk", "--bins"]);
    build.args(APPS.iter().flat_map(|app| ["--package", app]));
    build.args(["--profile", PROFILE, "--target", TARGET]);
    build.env("CARGO_TARGET_DIR", target).env("CARGO_ENCODED_RUSTFLAGS", remap(target)?);
    shell::run(build.env("CARGO_INCREMENTAL", "0"))?;
    let programs = Programs { folder: target.join(TARGET).join(PROFILE) };
    for name in PROGRAMS {
        let path = programs.path(name);
        let bytes = fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        if !is_static(&bytes)? {
            return Err(format!("{} is not linked statically", path.display()));
        }
        if let Some(folder) = [shell::workspace_root(), home()?].iter().find(|it| names(&bytes, it))
        {
            return Err(format!(
                "{} contains the name of the folder {}",
                path.display(),
                folder.display()
            ));
        }
    }
    Ok(programs)
}

/// Compiler flags that replace the folders of this machine in panic messages. If several match, the last one applies.
fn remap(target: &Path) -> Result<String, String> {
    let (root, home) = (shell::workspace_root(), home()?);
    let flag = |from: &Path, to: &str| format!("--remap-path-prefix={}={to}", from.display());
    Ok([flag(&root, "/rollwalk"), flag(target, "/target"), flag(&home, "/cargo")].join("\x1f"))
}

/// Folder of cargo, with the sources of dependencies.
fn home() -> Result<PathBuf, String> {
    let chosen = env::var_os("CARGO_HOME").map(PathBuf::from);
    let usual = || env::home_dir().map(|home| home.join(".cargo"));
    chosen.or_else(usual).ok_or_else(|| "there is no home folder: set CARGO_HOME".into())
}

/// True for a static program, which imports no symbols.
fn is_static(program: &[u8]) -> Result<bool, String> {
    let file = object::File::parse(program).map_err(|error| {
        format!(
            "the built file is not a \
        program: {error}"
        )
    })?;
    let mut imports = file.imports().map_err(|error| error.to_string())?;
    Ok(imports.next().is_none())
}

/// True if the path of a folder occurs in a program.
fn names(program: &[u8], folder: &Path) -> bool {
    let folder = folder.as_os_str().as_encoded_bytes();
    program.windows(folder.len()).any(|bytes| bytes == folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_of_this_machine_s_libraries_is_no_static_one() {
        // The program of this test.
        let program = fs::read(env::current_exe().unwrap()).unwrap();
        assert!(!is_static(&program).unwrap());
        assert!(is_static(b"#!/bin/sh").is_err());
    }

    #[test]
    fn folders_in_a_program_are_found() {
        assert!(names(b"at /srv/ann/x/src/lib.rs", Path::new("/srv/ann/x")));
        assert!(!names(b"at /rollwalk/src/lib.rs", Path::new("/srv/ann/x")));
    }
}
