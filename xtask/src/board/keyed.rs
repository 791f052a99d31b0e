//! Tests of images with keys. The emulated board must accept only a host with its link key, and only libraries with its owner's
//! signature. The check also reports the sizes of the real boards' images.

use super::bench::{Bench, KeyFiles};
use super::image::MPS2_AN386;
use super::{contents, key_block, own};
use crate::shell;
use std::fs;
use std::path::PathBuf;

/// Robot of images that are not for a particular robot.
const ROBOT: &str = "shipped/robots/agilebot.toml";

/// Public test keys. The bytes of the private key are 1, as in the OpenSSL keys of the command line's tests.
const LINK: &str = "5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a";
const OTHER_LINK: &str = "a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5";
const PRIVATE: &str = "MC4CAQAwBQYDK2VwBCIEIAEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEB";
const PUBLIC: &str = "MCowBQYDK2VwAyEAiojj3XQJ8ZX9UtstPLpdcspnCb8dlBIb83SIAbQPb1w=";

/// Temporary files with keys.
struct Keys {
    folder: tempfile::TempDir,
}

impl Keys {
    fn new() -> Result<Self, String> {
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let keys = Self { folder };
        let pem =
            |kind: &str, key| format!("-----BEGIN {kind}-----\n{key}\n-----END {kind}-----\n");
        for (name, text) in [
            ("robot.key", format!("rollwalk-link-key-1 {LINK}\n")),
            ("other.key", format!("rollwalk-link-key-1 {OTHER_LINK}\n")),
            ("owner.pem", pem("PRIVATE KEY", PRIVATE)),
            ("owner.pub.pem", pem("PUBLIC KEY", PUBLIC)),
        ] {
            let path = keys.at(name);
            own::save(&path, text.as_bytes(), true)
                .map_err(|error| format!("{}: {error}", path.display()))?;
        }
        Ok(keys)
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Key files for an image with both keys.
    fn files(&self) -> KeyFiles {
        let [link, library] = ["robot.key", "owner.pub.pem"].map(|name| Some(self.at(name)));
        KeyFiles { link_key: link, library_key: library }
    }
}

/// Fills both keys into the image of the emulated board, and compares it with the simulation.
///
/// A host without a key, a host with another key, and a library without a signature must be refused. The same image with blank
/// keys must not start.
///
/// # Errors
/// Returns the first difference, or an error if something was not refused.
pub fn check(bench: &Bench) -> Result<(), String> {
    let keys = Keys::new()?;
    let path = keys.at("image.elf");
    let blank = MPS2_AN386.build_with_keys(bench, "authenticated,signed")?;
    let mut built = contents::read(&blank)?;
    let block = bench.key_block(&shell::workspace_root().join(ROBOT), &keys.files())?;
    key_block::fill(&mut built, &block)?;
    fs::write(&path, built).map_err(|error| error.to_string())?;
    let [link, other, signing] = ["robot.key", "other.key", "owner.pem"].map(|name| keys.at(name));
    bench.uart_with_keys(&path, Some(&link), Some(&signing))?;
    for (link, signing, why) in [
        (None, Some(&signing), "authentication"),
        (Some(&other), Some(&signing), "another link key"),
        (Some(&link), None, "not signed"),
    ] {
        match bench.uart_with_keys(&path, link.map(PathBuf::as_path), signing.map(PathBuf::as_path))
        {
            Ok(()) => {
                return Err(format!(
                    "the board accepts a host that it must refuse: link key \
                    {link:?}, signing key {signing:?}"
                ));
            }
            Err(refusal) if refusal.contains(why) => eprintln!("refused as required: {refusal}"),
            Err(other) => return Err(other),
        }
    }
    match bench.uart_with_keys(&blank, Some(&link), Some(&signing)) {
        Err(silent) if silent.contains("the link is down") => Ok(()),
        Err(other) => Err(format!(
            "the image without keys failed with another error than silence: \
            {other}"
        )),
        Ok(()) => Err("the image without keys starts, although it must not".into()),
    }
}
