//! Debian packages that a step needs. They are installed if the process runs as root; otherwise the error contains the command
//! that installs them. Packages can also be downloaded without installation.

use crate::shell::{self, command};
use std::fs;
use std::path::{Path, PathBuf};

/// Installs packages that are missing.
///
/// # Errors
/// Returns the command that installs them if this user or machine cannot.
pub fn need(packages: &[&str]) -> Result<(), String> {
    let installed = || {
        packages.iter().all(|package| {
            let query = ["-W", "-f=${Status}", package];
            shell::output(&mut command("dpkg-query", &query))
                .is_ok_and(|status| status.ends_with(" installed"))
        })
    };
    if installed() {
        return Ok(());
    }
    let _alone = shell::installing()?;
    if installed() {
        return Ok(());
    }
    let mut install = vec!["install", "-y", "--no-install-recommends"];
    install.extend(packages);
    if update() {
        let mut apt = command("apt-get", &install);
        if shell::run(apt.env("DEBIAN_FRONTEND", "noninteractive")).is_ok() && installed() {
            return Ok(());
        }
    }
    Err(format!("sudo apt-get {}", install.join(" ")))
}

/// Returns the control data of a package in the version that would be installed.
///
/// # Errors
/// Returns an error if the package is unknown even after an update of the package lists.
pub fn control(package: &str) -> Result<String, String> {
    let show = || {
        let mut show = command("apt-cache", &["show", "--no-all-versions", package]);
        shell::output(&mut show).ok().filter(|control| !control.is_empty())
    };
    let _alone = shell::installing()?;
    show().or_else(|| if update() { show() } else { None }).ok_or_else(|| {
        format!(
            "the Debian package {package} is not in the package lists; on Debian for amd64, \
            update the lists with:\n\n    {UPDATE}"
        )
    })
}

/// Downloads and verifies a package in a separate folder; resumes a partial download.
///
/// # Errors
/// Returns the package manager's error, even after an update of the package lists.
pub fn download(package: &str, version: &str, folder: &Path) -> Result<PathBuf, String> {
    fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let _alone = shell::installing()?;
    let get = || {
        let mut apt = command("apt-get", &["download", &format!("{package}={version}")]);
        shell::output(apt.current_dir(folder))
    };
    get().or_else(|why| if update() { get() } else { Err(format!("{why}\n\n    {UPDATE}")) })?;
    let files = fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut names = files.filter_map(|file| file.ok().map(|file| file.path()));
    let is_package = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "deb");
    names.find(is_package).ok_or_else(|| format!("apt-get download wrote no package {package}"))
}

const UPDATE: &str = "sudo apt-get update";

/// Updates the package lists, which only root can do; returns true on success.
fn update() -> bool {
    let is_root = shell::output(&mut command("id", &["-u"])).is_ok_and(|id| id.trim() == "0");
    is_root && shell::run(&mut command("apt-get", &["update"])).is_ok()
}
