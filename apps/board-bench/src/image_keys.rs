//! Keys for an image, from their files to the block that `cargo xtask image` fills in.

use ed25519_dalek::pkcs8::{DecodePrivateKey, DecodePublicKey};
use ed25519_dalek::{Signer, SigningKey, VerifyingKey};
use rollwalk_firmware::hal::key_block::Keys;
use rollwalk_host::key_file;
use rollwalk_protocol::library::{FINGERPRINT_LEN, signature_head};
use std::fmt::Write;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// More than any file with a key has.
const MAX_FILE: u64 = 1 << 10;

/// The block with the keys of these files, as hexadecimal digits.
///
/// # Errors
/// A file that cannot be read, or that has no such key in it, and what it should be.
pub fn block(link: Option<&Path>, library: Option<&Path>) -> Result<String, String> {
    let keys = Keys {
        link: link.map(link_key).transpose()?,
        library: library.map(library_key).transpose()?,
    };
    Ok(keys.encode().iter().fold(String::new(), |mut digits, byte| {
        let _ = write!(digits, "{byte:02x}");
        digits
    }))
}

/// The link key of a file.
///
/// # Errors
/// As for [`block`].
pub fn link_key(path: &Path) -> Result<[u8; 32], String> {
    let text = text(path, "link key", "`rollwalk keys new FILE` makes one")?;
    let key = key_file::parse(&text).ok_or_else(|| {
        let help = match text.contains("PUBLIC KEY") || text.contains("PRIVATE KEY") {
            true => {
                "it is one of a pair, for signing libraries, and --library-key takes its public one"
            }
            false => "`rollwalk keys new FILE` makes one",
        };
        format!("{} {}; {help}", path.display(), key_file::refusal())
    })?;
    if key_file::is_open_to_others(path) {
        let path = path.display();
        eprintln!("other users of this computer can read the key in {path}: chmod 600 {path}");
    }
    Ok(key)
}

/// The private key of a file, for signing the libraries of a test.
///
/// # Errors
/// The file cannot be read, or holds no such key.
pub fn signing_key(path: &Path) -> Result<SigningKey, String> {
    let text = text(path, "private key (PEM)", "`rollwalk keys new-pair KEY.pem` makes one")?;
    SigningKey::from_pkcs8_pem(&text)
        .map_err(|error| format!("{}: no private Ed25519 key in PEM: {error}", path.display()))
}

/// A library with a signature behind it.
pub fn signed(library: &[u8], key: &SigningKey) -> Vec<u8> {
    // The fingerprint is for people, who read none of this.
    let mut file = [library, &signature_head([0; FINGERPRINT_LEN])].concat();
    let signature = key.sign(&file);
    file.extend(signature.to_bytes());
    file
}

fn library_key(path: &Path) -> Result<[u8; 32], String> {
    let pair = "`rollwalk keys new-pair KEY.pem` makes one, KEY.pub.pem";
    let text = text(path, "public key (PEM)", pair)?;
    let key = VerifyingKey::from_public_key_pem(&text).ok().filter(|key| !key.is_weak());
    key.map(|key| key.to_bytes()).ok_or_else(|| {
        let help = match () {
            () if text.contains("PRIVATE KEY") => {
                "it is a private key, which no robot must have: give the public one, such as KEY.pub.pem"
            }
            () if key_file::parse(&text).is_some() => "it is a link key, which --link-key takes",
            () => pair,
        };
        format!("{} is no public Ed25519 key in PEM; {help}", path.display())
    })
}

/// The text of a file with a key, which is short.
fn text(path: &Path, kind: &str, help: &str) -> Result<String, String> {
    let name = path.display();
    let failed = |error| format!("{name}: {error}; a {kind} is wanted; {help}");
    let mut bytes = Vec::new();
    let mut file = File::open(path).map_err(failed)?.take(MAX_FILE + 1);
    file.read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > MAX_FILE {
        return Err(format!("{name} has more than {MAX_FILE} bytes, and is no {kind}; {help}"));
    }
    // Text of another encoding is no key either, and is refused as such.
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
