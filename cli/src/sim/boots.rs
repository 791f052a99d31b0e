//! Boot counts of simulated controllers with a link key, kept in the user's state folder. Session numbers start with the count,
//! so that a recorded session is not valid after a restart.

use directories::ProjectDirs;
use miette::{IntoDiagnostic, WrapErr, miette};
use rollwalk_protocol::wire::authentication::{LinkKey, LinkSession};
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Session number that no controller offers. The tag of this session identifies a key in a file name without revealing the key.
const NO_SESSION: LinkSession = LinkSession { number: u64::MAX, nonce: 0 };

/// Counts a boot of a controller with a key, and returns a number above that of every previous boot. Returns `None` if the user
/// has no state folder.
///
/// # Errors
/// Returns an error if the file was not written by this function, or if the operating system refuses.
pub fn count(key: &LinkKey) -> miette::Result<Option<u32>> {
    count_path(key).map(|path| count_in(&path)).transpose()
}

/// Path of the count for a key. Several robots and files may share a key, so the path depends only on the key.
fn count_path(key: &LinkKey) -> Option<PathBuf> {
    let folders = ProjectDirs::from("", "", "rollwalk")?;
    let folder = folders.state_dir().unwrap_or(folders.data_local_dir());
    let name: String =
        key.offer_tag(&NO_SESSION, 0).iter().map(|byte| format!("{byte:02x}")).collect();
    Some(folder.join("boots").join(name))
}

fn count_in(path: &Path) -> miette::Result<u32> {
    let failed = || format!("cannot count the boots of the controller in {}", path.display());
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).into_diagnostic().wrap_err_with(failed)?;
    }
    // A second simulator with the same key waits for its own number.
    let mut file: File = OpenOptions::new()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(path)
        .and_then(|file| file.lock().map(|()| file))
        .into_diagnostic()
        .wrap_err_with(failed)?;
    let mut text = String::new();
    file.read_to_string(&mut text).into_diagnostic().wrap_err_with(failed)?;
    let last = match text.trim_end() {
        // The file was created, but never written.
        "" => Some(0),
        digits => digits.parse::<u32>().ok(),
    };
    let next = last.and_then(|last| last.checked_add(1)).ok_or_else(|| {
        miette!(
            help = "remove the file, and give the robot and its hosts a new key; otherwise \
                sessions recorded with the old key could be replayed",
            "{} does not contain a boot count below {}",
            path.display(),
            u32::MAX
        )
    })?;
    // The length is constant, so that a write replaces the previous number completely.
    let written = file
        .rewind()
        .and_then(|()| file.write_all(format!("{next:010}\n").as_bytes()))
        .and_then(|()| file.sync_all());
    written.into_diagnostic().wrap_err_with(failed)?;
    Ok(next)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_rise_over_restarts_and_damage_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("boots/of_a_key");
        assert_eq!([count_in(&path).unwrap(), count_in(&path).unwrap()], [1, 2]);
        fs::write(&path, "0000000009\n").unwrap();
        assert_eq!(count_in(&path).unwrap(), 10);
        for damaged in ["4294967295\n", "-1", "12 13", "x"] {
            fs::write(&path, damaged).unwrap();
            let error = format!("{:?}", count_in(&path).unwrap_err());
            assert!(error.contains("does not contain a boot count"), "{damaged}: {error}");
        }
    }

    #[test]
    fn simulators_with_one_key_get_numbers_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("boots");
        let at_once: Vec<_> = (0..8)
            .map(|_| {
                let path = path.clone();
                std::thread::spawn(move || count_in(&path).unwrap())
            })
            .collect();
        let mut numbers: Vec<_> = at_once.into_iter().map(|of| of.join().unwrap()).collect();
        numbers.sort_unstable();
        assert_eq!(numbers, (1..=8).collect::<Vec<_>>());
    }
}
