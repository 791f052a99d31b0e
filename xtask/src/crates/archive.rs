//! Check of a package's contents: its README, and the licences of the checkout.

use super::Published;
use crate::shell;
use std::fs;
use std::path::Path;

/// Files that every package must contain, identical to those in the crate's folder.
const OF_CRATE: [&str; 1] = ["README.md"];
/// Files that every package must contain, identical to those in the root of the checkout.
const OF_CHECKOUT: [&str; 2] = ["LICENSE-APACHE", "LICENSE-MIT"];
/// Maximum size of a package in the registry, bytes.
const BYTES_MAX: u64 = 10 * 1024 * 1024;

/// Returns the defects of a package.
///
/// # Errors
/// Returns an error if the package does not exist where cargo writes it, or is not an archive.
pub fn violations(one: &Published, archive: &Path) -> Result<Vec<String>, String> {
    let failed = |path: &Path, error| format!("{}: {error}", path.display());
    let bytes = fs::metadata(archive).map_err(|error| failed(archive, error))?.len();
    let mut found = Vec::new();
    if bytes > BYTES_MAX {
        found.push(format!(
            "{}: the package has {bytes} bytes; at most {BYTES_MAX} are allowed",
            archive.display()
        ));
    }
    let root = shell::workspace_root();
    let texts = OF_CRATE.map(|name| (name, one.folder.join(name)));
    let licences = OF_CHECKOUT.map(|name| (name, root.join(name)));
    for (name, path) in texts.into_iter().chain(licences) {
        let expected = fs::read(&path).map_err(|error| failed(&path, error))?;
        let mut unpack = shell::command("tar", &["--extract", "--gzip", "--to-stdout", "--file"]);
        unpack.arg(archive).arg(format!("{}/{name}", one.stem()));
        match shell::bytes(&mut unpack) {
            Ok(packaged) if packaged == expected => {}
            Ok(_) => {
                found.push(format!("{}: {name} differs between package and checkout", one.name))
            }
            Err(why) => found.push(format!("{}: the package lacks {name}: {why}", one.name)),
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_must_be_in_the_package_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let one = Published {
            name: "a".into(),
            version: "0.1.0".into(),
            folder: folder.path().to_owned(),
        };
        let inside = folder.path().join(one.stem());
        let archive = folder.path().join("a.crate");
        let found = || {
            let mut pack = shell::command("tar", &["--create", "--gzip", "--file"]);
            pack.arg(&archive).arg("--directory").arg(folder.path()).arg(one.stem());
            shell::run(&mut pack).unwrap();
            violations(&one, &archive).unwrap()
        };
        fs::create_dir(&inside).unwrap();
        fs::write(folder.path().join("README.md"), "# a\n").unwrap();
        fs::write(inside.join("README.md"), "# a\n").unwrap();
        for name in OF_CHECKOUT {
            fs::copy(shell::workspace_root().join(name), inside.join(name)).unwrap();
        }
        assert_eq!(found(), Vec::<String>::new());

        // Content of a symbolic link that git writes where links are not supported.
        fs::write(inside.join("LICENSE-MIT"), "../LICENSE-MIT").unwrap();
        assert_eq!(found(), ["a: LICENSE-MIT differs between package and checkout"]);
        fs::remove_file(inside.join("README.md")).unwrap();
        let found = found();
        assert!(
            found.len() == 2 && found[0].starts_with("a: the package lacks README.md"),
            "{found:?}"
        );
        assert!(violations(&one, &folder.path().join("gone.crate")).is_err());
    }
}
