//! Count of the boots of simulated controllers with a link key, kept in the user's state folder. Numbers of sessions begin with
//! it: a recorded session must not be one again after a restart.

use directories::ProjectDirs;
use miette::{IntoDiagnostic, WrapErr, miette};
use rollwalk_protocol::wire::authentication::{LinkKey, LinkSession};
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Session that no controller offers: its tag names the key without telling it.
const NO_SESSION: LinkSession = LinkSession { number: u64::MAX, nonce: 0 };

/// Counts a boot of a controller with a key: a number above that of every boot before; `None` where there is no folder to keep
/// it in.
///
/// # Errors
/// The file is not what this function wrote, or the operating system refuses.
pub fn count(key: &LinkKey) -> miette::Result<Option<u32>> {
    place(key).map(|path| count_in(&path)).transpose()
}

/// A file for each key: the same key may be that of several robots, and of files in several places.
fn place(key: &LinkKey) -> Option<PathBuf> {
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
    // Another simulator with the same key waits for its own number.
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
        // Made, and never written.
        "" => Some(0),
        digits => digits.parse::<u32>().ok(),
    };
    let next = last.and_then(|last| last.checked_add(1)).ok_or_else(|| {
        miette!(
            help = "remove it, and give the robot and its hosts a new key: sessions that were recorded with this one may be repeated otherwise",
            "{} is no count of boots below {}",
            path.display(),
            u32::MAX
        )
    })?;
    // Always as long, so that it takes the place of the one before as a whole.
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
            assert!(error.contains("no count of boots"), "{damaged}: {error}");
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
