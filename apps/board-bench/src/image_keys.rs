//! Keys for an image, from key files to the block that `cargo xtask image` inserts.

use ed25519_dalek::pkcs8::{DecodePrivateKey, DecodePublicKey};
use ed25519_dalek::{Signer, SigningKey, VerifyingKey};
use rollwalk_firmware::hal::key_block::Keys;
use rollwalk_host::key_file;
use rollwalk_protocol::library::{FINGERPRINT_LEN, signature_head};
use std::fmt::Write;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Maximum size of a key file, bytes.
const MAX_FILE: u64 = 1 << 10;

/// Encodes the keys of the given files as the key block of an image, in hexadecimal digits.
///
/// # Errors
/// Returns an error if a file cannot be read or does not contain a key of its kind.
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

/// Reads a link key.
///
/// # Errors
/// Returns an error if the file cannot be read or does not contain a link key.
pub fn link_key(path: &Path) -> Result<[u8; 32], String> {
    let text = text(path, "link key", "make a link key with `rollwalk keys new FILE`")?;
    let key = key_file::parse(&text).ok_or_else(|| {
        let help = match text.contains("PUBLIC KEY") || text.contains("PRIVATE KEY") {
            true => {
                "give a link key, and pass the public key of a signing key pair to --library-key"
            }
            false => "make a link key with `rollwalk keys new FILE`",
        };
        format!("{} {}; {help}", path.display(), key_file::refusal())
    })?;
    if key_file::is_open_to_others(path) {
        let path = path.display();
        eprintln!(
            "other users of this computer can read the key in {path}: run `chmod 600 {path}`"
        );
    }
    Ok(key)
}

/// Reads a private key, to sign the library of a test.
///
/// # Errors
/// Returns an error if the file cannot be read or does not contain a private key.
pub fn signing_key(path: &Path) -> Result<SigningKey, String> {
    let text =
        text(path, "private key (PEM)", "make a key pair with `rollwalk keys new-pair KEY.pem`")?;
    SigningKey::from_pkcs8_pem(&text)
        .map_err(|error| format!("{} is not a private Ed25519 key in PEM: {error}", path.display()))
}

/// Appends a signature to a library.
pub fn signed(library: &[u8], key: &SigningKey) -> Vec<u8> {
    // The fingerprint helps people. This test does not read it.
    let mut file = [library, &signature_head([0; FINGERPRINT_LEN])].concat();
    let signature = key.sign(&file);
    file.extend(signature.to_bytes());
    file
}

fn library_key(path: &Path) -> Result<[u8; 32], String> {
    let pair = "make a key pair with `rollwalk keys new-pair KEY.pem`, and give KEY.pub.pem";
    let text = text(path, "public key (PEM)", pair)?;
    let key = VerifyingKey::from_public_key_pem(&text).ok().filter(|key| !key.is_weak());
    key.map(|key| key.to_bytes()).ok_or_else(|| {
        let help = match () {
            () if text.contains("PRIVATE KEY") => {
                "give the public key of the pair, such as KEY.pub.pem, because no robot may have \
                 the private key"
            }
            () if key_file::parse(&text).is_some() => "pass this link key to --link-key",
            () => pair,
        };
        format!("{} is not a public Ed25519 key in PEM; {help}", path.display())
    })
}

/// Reads the text of a key file, which must be short.
fn text(path: &Path, kind: &str, help: &str) -> Result<String, String> {
    let name = path.display();
    let failed = |error| format!("{name}: {error} (expected a {kind}); {help}");
    let mut bytes = Vec::new();
    let mut file = File::open(path).map_err(failed)?.take(MAX_FILE + 1);
    file.read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > MAX_FILE {
        return Err(format!("{name} has more than {MAX_FILE} bytes and is not a {kind}; {help}"));
    }
    // Text in another encoding is not a key either, and is refused with the same message.
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
