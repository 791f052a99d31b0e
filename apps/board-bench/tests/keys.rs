//! Tests that key blocks are made only from valid key files.

use rollwalk_firmware::hal::key_block::{KEY_LEN, Keys, LEN};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const LINK: [u8; KEY_LEN] = [0x5A; KEY_LEN];
/// Public key, made by `openssl pkey -pubout` from a private key whose bytes are all 1.
const PUBLIC: &str = "-----BEGIN PUBLIC KEY-----\n\
                      MCowBQYDK2VwAyEAiojj3XQJ8ZX9UtstPLpdcspnCb8dlBIb83SIAbQPb1w=\n\
                      -----END PUBLIC KEY-----\n";
const PRIVATE: &str = "-----BEGIN PRIVATE KEY-----\n\
                       MC4CAQAwBQYDK2VwBCIEIAEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEB\n\
                       -----END PRIVATE KEY-----\n";

/// Returns the hexadecimal digits of a key block and the other output of the command, or its error.
fn block(options: &[(&str, &Path)]) -> Result<(String, String), String> {
    let mut bench = Command::new(env!("CARGO_BIN_EXE_rollwalk-board-bench"));
    bench
        .arg("key-block")
        .args(options.iter().flat_map(|(name, path)| [name.as_ref(), path.as_os_str()]));
    let output =
        bench.current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")).output().unwrap();
    let [out, error] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    if output.status.success() { Ok((out, error)) } else { Err(error) }
}

fn keys(digits: &str) -> Keys {
    let mut block = [0; LEN];
    assert_eq!(digits.len(), 2 * LEN);
    for (byte, at) in block.iter_mut().zip((0..).step_by(2)) {
        *byte = u8::from_str_radix(&digits[at..at + 2], 16).unwrap();
    }
    Keys::decode(&block).unwrap()
}

struct Files(tempfile::TempDir);

impl Files {
    fn write(&self, name: &str, text: &str, mode: u32) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, text).unwrap();
        #[cfg(unix)]
        fs::set_permissions(&path, std::os::unix::fs::PermissionsExt::from_mode(mode)).unwrap();
        path
    }
}

#[test]
fn a_block_has_the_keys_of_the_files() {
    let files = Files(tempfile::tempdir().unwrap());
    let link = files.write("robot.key", &rollwalk_host::key_file::text(&LINK), 0o600);
    let library = files.write("owner.pub.pem", PUBLIC, 0o644);
    let (digits, said) = block(&[("--link-key", &link), ("--library-key", &library)]).unwrap();
    let both = keys(&digits);
    assert_eq!(both.link, Some(LINK));
    assert_eq!(both.library.unwrap()[..4], [0x8A, 0x88, 0xE3, 0xDD]);
    // A public key is not secret.
    assert_eq!(said, "");
    assert!(keys(&block(&[("--link-key", &link)]).unwrap().0).library.is_none());
    assert!(keys(&block(&[("--library-key", &library)]).unwrap().0).link.is_none());

    #[cfg(unix)]
    {
        let open = files.write("open.key", &rollwalk_host::key_file::text(&LINK), 0o644);
        let (_, said) = block(&[("--link-key", &open)]).unwrap();
        assert!(said.contains("other users") && said.contains("chmod 600"), "{said}");
        assert!(!said.contains("5a5a"), "{said}");
    }
}

#[test]
fn what_is_no_key_says_what_it_is_and_what_would_be_right() {
    let files = Files(tempfile::tempdir().unwrap());
    let link = files.write("robot.key", &rollwalk_host::key_file::text(&LINK), 0o644);
    let public = files.write("owner.pub.pem", PUBLIC, 0o644);
    let private = files.write("owner.pem", PRIVATE, 0o644);
    let cut = files.write("cut.key", &rollwalk_host::key_file::text(&LINK)[..50], 0o644);
    let large = files.write("large", &"5".repeat(2000), 0o644);
    let none = files.0.path().join("none");
    for (option, path, expected) in [
        ("--link-key", &cut, "is not a link key; expected one line"),
        ("--link-key", &public, "the public key of a signing key pair to --library-key"),
        ("--link-key", &none, "make a link key with `rollwalk keys new FILE`"),
        ("--link-key", &large, "has more than 1024 bytes"),
        ("--library-key", &link, "pass this link key to --link-key"),
        ("--library-key", &private, "because no robot may have the private key"),
        ("--library-key", &cut, "make a key pair with `rollwalk keys new-pair KEY.pem`"),
    ] {
        let why = block(&[(option, path)]).unwrap_err();
        assert!(why.contains(expected), "{why}");
        assert!(why.contains(path.to_str().unwrap()), "{why}");
        // The message contains no secret, and no advice to protect a file that is no secret.
        assert!(!why.contains("5a5a") && !why.contains("chmod") && !why.contains("MC4C"), "{why}");
    }
}
