//! Debian's kernel, downloaded and unpacked below the target folder, never installed.
//!
//! Its folder is named after package and version, so that a new version does not replace a kernel in use.

use crate::shell::{self, command};
use crate::{debian, vcan};
use std::fs;
use std::path::{Path, PathBuf};

/// Package that depends on Debian's current kernel.
const META_PACKAGE: &str = "linux-image-amd64";
const PREFIX: &str = "linux-image-";

pub struct Kernel {
    /// Folder with the files of the kernel.
    pub folder: PathBuf,
    /// Release, as in `uname -r`.
    pub release: String,
}

impl Kernel {
    /// Returns the current kernel, from the cache or downloaded.
    ///
    /// # Errors
    /// Returns the package manager's error.
    pub fn get() -> Result<Self, String> {
        let control = debian::control(META_PACKAGE)?;
        let Some((package, version)) = dependency(&control) else {
            return Err(format!("{META_PACKAGE} depends on no kernel package:\n{control}"));
        };
        let release = package.strip_prefix(PREFIX).expect("that is what was looked for").to_owned();
        let cache = vcan::cache()?;
        let folder = cache.join(format!("{package}_{version}"));
        if !folder.exists() {
            eprintln!("downloading {package} {version}, 70 to 100 MB");
            // One folder for each version, so that its package is always that version.
            let download = cache.join(format!("{package}_{version}.download"));
            let archive = debian::download(package, version, &download)?;
            unpack(&archive, &folder, &release)?;
            fs::remove_dir_all(&download).map_err(|e| format!("{}: {e}", download.display()))?;
        }
        Ok(Self { folder, release })
    }

    /// Path of the kernel image.
    pub fn image(&self) -> PathBuf {
        self.folder.join("boot").join(format!("vmlinuz-{}", self.release))
    }
}

/// Unpacks completely or not at all: an interrupted run leaves no folder with the final name.
fn unpack(archive: &Path, folder: &Path, release: &str) -> Result<(), String> {
    let part = folder.with_extension("part");
    if part.exists() {
        fs::remove_dir_all(&part).map_err(|error| format!("{}: {error}", part.display()))?;
    }
    shell::output(command("dpkg-deb", &["-x"]).arg(archive).arg(&part))?;
    shell::output(shell::system("depmod", &["-b"]).arg(&part).arg(release))?;
    fs::rename(&part, folder).map_err(|error| format!("{}: {error}", folder.display()))
}

/// Parses package and version in `Depends: linux-image-6.1.0-56-amd64 (= 6.1.192-2)`.
fn dependency(control: &str) -> Option<(&str, &str)> {
    let depends = control.lines().find_map(|line| line.strip_prefix("Depends:"))?;
    depends.split(',').find_map(|one| {
        let (package, version) = one.trim().split_once(" (= ")?;
        package.starts_with(PREFIX).then_some((package, version.strip_suffix(')')?))
    })
}

#[cfg(test)]
mod tests {
    use super::dependency;

    #[test]
    fn the_dependency_names_package_and_version() {
        let control = "Package: linux-image-amd64\nPre-Depends: dpkg\nDepends: base (= 1), \
                       linux-image-6.1.0-56-amd64 (= 6.1.192-2)\nSize: 1480\n";
        assert_eq!(dependency(control), Some(("linux-image-6.1.0-56-amd64", "6.1.192-2")));
        assert_eq!(dependency("Package: linux-image-amd64\n"), None);
        assert_eq!(dependency("Depends: linux-image-6.1.0-56-amd64"), None);
    }
}
