//! Test of the Debian package on a minimal Debian: installs it and follows the tutorial of the README.

use super::build::PROGRAMS;
use super::{failed, make_folder};
use crate::markdown::Page;
use crate::{debian, shell};
use std::fs;
use std::path::Path;
use std::process::Command;

const RELEASE: &str = "bookworm";
/// Anchor of the tutorial in the README.
const TUTORIAL: &str = "your-own-robot-and-motion-in-ten-minutes";
/// Folder of the tutorial in the minimal Debian.
const FOLDER: &str = "home/tutorial";

/// Sample of the package's files, of each kind.
const INSTALLED: [&str; 6] = [
    "usr/share/man/man1/rollwalk-plan.1.gz",
    "usr/share/man/man1/rollwalk-bench-table-2-1.1.gz",
    "usr/share/man/man1/rollwalk-ros2.1.gz",
    "usr/share/bash-completion/completions/rollwalk-ros2",
    "usr/share/zsh/vendor-completions/_rollwalk",
    "usr/lib/udev/rules.d/70-rollwalk.rules",
];

/// Installs the package in a fresh Debian and follows the tutorial.
///
/// # Errors
/// Returns the failed command with its output. If a program is missing, the error contains the command that installs it.
pub fn check(package: &Path) -> Result<(), String> {
    let root = shell::target_folder().join("package").join(RELEASE);
    install_debian(&root)?;
    let place = root.join("rollwalk.deb");
    fs::copy(package, &place).map_err(|error| failed(package, &error))?;
    shell::output(&mut inside(&root, "/", "dpkg --install /rollwalk.deb"))?;
    for file in INSTALLED {
        if !root.join(file).exists() {
            return Err(format!("the package did not install /{file}"));
        }
    }
    for program in PROGRAMS {
        shell::output(&mut inside(&root, "/", &format!("{program} --version")))?;
    }
    let tutorial = Tutorial::read(&super::read(&shell::workspace_root().join("README.md"))?)?;
    let folder = root.join(FOLDER);
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(|error| failed(&folder, &error))?;
    }
    make_folder(&folder)?;
    for (name, text) in &tutorial.files {
        super::write_file(&folder.join(name), text)?;
    }
    for line in &tutorial.commands {
        eprintln!("{line}");
        shell::output(&mut inside(&root, &format!("/{FOLDER}"), line))?;
    }
    Ok(())
}

/// Creates a command in another root, without this environment's variables.
fn inside(root: &Path, folder: &str, line: &str) -> Command {
    let mut command = shell::system("chroot", &[root]);
    command.args(["/bin/sh", "-c", &format!("cd {folder} && {line}")]);
    command.env_clear().env("PATH", "/usr/bin:/usr/sbin:/bin:/sbin").env("HOME", "/root");
    command
}

/// Installs Debian into the root if it is empty, from the package source of this machine.
fn install_debian(root: &Path) -> Result<(), String> {
    if root.join("etc/debian_version").exists() {
        return Ok(());
    }
    debian::need(&["debootstrap"]).map_err(|install| {
        format!("the check requires debootstrap. On Debian:\n\n    {install}")
    })?;
    let targets =
        ["indextargets", "--format", "$(SITE)", "Created-By: Packages", "Component: main"];
    let sites = shell::output(&mut shell::command("apt-get", &targets))?;
    let site =
        sites.lines().next().ok_or("apt has no package source: run `sudo apt-get update`")?;
    // An interrupted copy would count as complete.
    let part = root.with_extension("part");
    if part.exists() {
        fs::remove_dir_all(&part).map_err(|error| failed(&part, &error))?;
    }
    let mut install = shell::system("debootstrap", &["--variant=minbase", RELEASE]);
    shell::output(install.arg(&part).arg(site))
        .map_err(|why| format!("{why}\nrun this check as root, which debootstrap requires"))?;
    fs::rename(&part, root).map_err(|error| failed(root, &error))
}

/// Files and commands of the tutorial, in order.
#[derive(Debug, PartialEq, Eq)]
struct Tutorial {
    files: Vec<(String, String)>,
    commands: Vec<String>,
}

impl Tutorial {
    fn read(readme: &str) -> Result<Self, String> {
        let page = Page::parse(readme);
        let section = page.section(TUTORIAL, readme);
        let (_, place) = section.ok_or_else(|| format!("README.md has no section `{TUTORIAL}`"))?;
        let page = Page::parse(&readme[place]);
        let (mut files, mut commands) = (Vec::new(), Vec::new());
        for block in page.blocks {
            match block.info.split_once(' ') {
                Some(("toml", name)) => files.push((name.to_owned(), block.code)),
                None if block.info == "sh" => {
                    let lines = block.code.lines().filter(|line| line.starts_with("rollwalk "));
                    commands.extend(lines.map(str::to_owned));
                }
                _ => {}
            }
        }
        if files.is_empty() || commands.is_empty() {
            return Err(format!("section `{TUTORIAL}` of README.md lacks files or commands"));
        }
        Ok(Self { files, commands })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_and_commands_of_the_tutorial_are_those_of_its_section() {
        let readme = "# A\n\n```sh\nrollwalk demo\n```\n\n## Your own robot and motion in ten minutes\n\n\
                      ```toml pup.toml\nname = \"pup\"\n```\n\n```sh\nrollwalk robot check pup.toml\n```\n\n\
                      ```sh not-run: hardware\nrollwalk estop\n```\n\n## B\n\n```sh\nrollwalk discover\n```\n";
        let files = vec![("pup.toml".to_owned(), "name = \"pup\"\n".to_owned())];
        let commands = vec!["rollwalk robot check pup.toml".to_owned()];
        assert_eq!(Tutorial::read(readme).unwrap(), Tutorial { files, commands });
        assert!(Tutorial::read("# A\n").is_err());
    }

    #[test]
    fn the_tutorial_of_readme_is_found() {
        let readme = super::super::read(&shell::workspace_root().join("README.md")).unwrap();
        let tutorial = Tutorial::read(&readme).unwrap();
        assert!(tutorial.files.iter().any(|(name, _)| name == "scout.toml"));
        assert!(tutorial.commands.iter().any(|line| line.starts_with("rollwalk library build")));
    }
}
