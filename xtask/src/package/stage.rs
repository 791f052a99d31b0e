//! Tree of files of the archive and the Debian package, laid out as below `/usr`.

use super::build::{APPS, PROGRAMS, Programs};
use super::{failed, make_folder, write_file};
use crate::shell;
use std::fs;
use std::path::Path;

/// Folder of the tree, next to the programs.
pub const FOLDER: &str = "package";
/// Shells, with their folder of completions, and the prefix and suffix of a completion file.
const SHELLS: [(&str, &str, &str, &str); 3] = [
    ("bash", "share/bash-completion/completions", "", ""),
    ("zsh", "share/zsh/site-functions", "_", ""),
    ("fish", "share/fish/vendor_completions.d", "", ".fish"),
];
/// Patterns of shipped files, for git.
const SHIPPED: [&str; 4] = [
    "shipped/robots/*.toml",
    "shipped/motions/*.toml",
    "shipped/designs/*.toml",
    "host/gamepads/*.toml",
];
const DOCUMENTS: [&str; 4] = ["README.md", "CHANGELOG.md", "LICENSE-APACHE", "LICENSE-MIT"];
const RULES: &str = "apps/packaging/udev/70-rollwalk.rules";

/// Writes the tree into `stage`, whose earlier files are removed.
///
/// # Errors
/// Returns an error if a file cannot be written, or if a program does not run on this machine.
pub fn write(programs: &Programs, stage: &Path) -> Result<(), String> {
    if stage.exists() {
        fs::remove_dir_all(stage).map_err(|error| failed(stage, &error))?;
    }
    let rollwalk = programs.path("rollwalk").to_string_lossy().into_owned();
    let manual = stage.join("share/man/man1");
    make_folder(&manual)?;
    shell::output(shell::command(&rollwalk, &["man", "--out"]).arg(&manual))?;
    for app in APPS {
        let app = programs.path(app).to_string_lossy().into_owned();
        shell::output(shell::command(&app, &["--man"]).arg(&manual))?;
    }
    // According to Debian's policy: without names and times of files.
    shell::run(shell::command("gzip", &["-9nr"]).arg(&manual))?;
    for program in PROGRAMS {
        copy(&programs.path(program), &stage.join("bin").join(program))?;
        for (name, folder, before, behind) in SHELLS {
            let mut print = match program {
                app if APPS.contains(&app) => {
                    let path = programs.path(app).to_string_lossy().into_owned();
                    shell::command(&path, &["--completions", name])
                }
                _ => shell::command(&rollwalk, &["completions", name, "--of", program]),
            };
            let script = shell::output(&mut print)?;
            make_folder(&stage.join(folder))?;
            write_file(&stage.join(folder).join(format!("{before}{program}{behind}")), &script)?;
        }
    }
    let root = shell::workspace_root();
    for path in shipped()? {
        copy(&root.join(&path), &stage.join("share/rollwalk").join(packaged(&path)))?;
    }
    for path in DOCUMENTS {
        copy(&root.join(path), &stage.join("share/doc/rollwalk").join(path))?;
    }
    let rules = Path::new(RULES);
    let name = rules.file_name().unwrap_or_default();
    copy(&root.join(rules), &stage.join("lib/udev/rules.d").join(name))
}

/// Path of a shipped file below `share/rollwalk`: the path without the folder of its crate.
fn packaged(path: &str) -> &str {
    path.split_once('/').map_or(path, |(_, rest)| rest)
}

/// Paths of the shipped robots, motions, designs and gamepad mappings.
fn shipped() -> Result<Vec<String>, String> {
    let mut list = shell::command("git", &["ls-files", "--"]);
    let paths = shell::output(list.args(SHIPPED))?;
    let paths = paths.lines().filter(|path| !path.ends_with("Cargo.toml"));
    Ok(paths.map(str::to_owned).collect())
}

/// Copies a file into a folder, which is created if it is missing.
fn copy(from: &Path, to: &Path) -> Result<(), String> {
    to.parent().map_or(Ok(()), make_folder)?;
    fs::copy(from, to).map(drop).map_err(|error| failed(from, &error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ships_is_found_in_folders_of_folders_and_no_manifest_with_it() {
        let shipped = shipped().unwrap();
        for path in
            ["robots/pup.toml", "motions/table_2_1/brainbot_turn.toml", "gamepads/xbox.toml"]
        {
            assert!(shipped.iter().any(|one| packaged(one) == path), "{path}");
        }
        assert!(shipped.len() > 60, "{} files", shipped.len());
        assert!(!shipped.iter().any(|one| one.contains("Cargo")));
    }
}
