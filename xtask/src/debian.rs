//! Debian packages that a step needs: installed when root, named with the one command otherwise.

use crate::shell::{self, command};

/// Makes sure that packages are installed.
///
/// # Errors
/// The one command that installs them, when this user or machine cannot.
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
    let mut install = vec!["install", "-y", "--no-install-recommends"];
    install.extend(packages);
    let is_root = shell::output(&mut command("id", &["-u"])).is_ok_and(|id| id.trim() == "0");
    if is_root && shell::run(&mut command("apt-get", &["update"])).is_ok() {
        let mut apt = command("apt-get", &install);
        if shell::run(apt.env("DEBIAN_FRONTEND", "noninteractive")).is_ok() && installed() {
            return Ok(());
        }
    }
    Err(format!("sudo apt-get {}", install.join(" ")))
}
