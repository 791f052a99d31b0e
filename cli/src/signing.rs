//! Signatures of motion libraries: signing, verification, and key pairs in PEM as used by OpenSSL (PKCS #8 and SPKI, RFC 8410).
//! `rollwalk_protocol::library::SignedFile` describes the format of a signed file.

use ed25519_dalek::pkcs8::spki::der::pem::LineEnding;
use ed25519_dalek::pkcs8::{
    DecodePrivateKey, DecodePublicKey, EncodePrivateKey, EncodePublicKey, KeypairBytes,
};
use ed25519_dalek::{Signature, Signer, SigningKey, VerifyingKey};
use miette::{IntoDiagnostic, miette};
use rollwalk_protocol::library::{FINGERPRINT_LEN, SignedFile, signature_head};
use rollwalk_terminal::files;
use rollwalk_terminal::keys::{random, warn_if_readable_by_others};
use rollwalk_terminal::kind::Kind;
use sha2::{Digest, Sha256};
use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};

/// Fingerprint of a public key, by which users distinguish keys: the first bytes of `openssl pkey -pubin -in KEY.pub.pem
/// -outform DER | sha256sum`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(pub [u8; FINGERPRINT_LEN]);

impl Fingerprint {
    /// Fingerprint of a key.
    pub fn of(key: &VerifyingKey) -> Self {
        let der = key.to_public_key_der().expect("44 bytes");
        let mut bytes = [0; FINGERPRINT_LEN];
        bytes.iter_mut().zip(Sha256::digest(der.as_bytes())).for_each(|(to, byte)| *to = byte);
        Self(bytes)
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// Newly created key pair.
pub struct Pair {
    /// File of the public key.
    pub public: PathBuf,
    /// Public key in PEM.
    pub pem: String,
    pub fingerprint: Fingerprint,
}

/// Creates a key pair: the private key in `path`, and the public key beside it, `owner.pub.pem` for `owner.pem`.
///
/// # Errors
/// Returns an error if a file exists or cannot be written, or if `path` is named like a public key.
pub fn new_pair(path: &Path) -> miette::Result<Pair> {
    let is_pub = |name: Option<&OsStr>| name.is_some_and(|name| name.eq_ignore_ascii_case("pub"));
    if is_pub(path.extension())
        || is_pub(path.file_stem().and_then(|stem| Path::new(stem).extension()))
    {
        return Err(miette!(
            help = "give the file name of the private key, such as owner.pem; the public key is \
                then written to owner.pub.pem",
            "{} is the file name of a public key, but would contain the private key of the pair",
            path.display()
        ));
    }
    let public = path.with_extension(match path.extension() {
        Some(ending) => format!("pub.{}", ending.to_string_lossy()),
        None => "pub".to_owned(),
    });
    let secret_key = random()?;
    let key = SigningKey::from_bytes(&secret_key).verifying_key();
    // Version 1 of PKCS #8, without the public key, because OpenSSL reads no other version.
    let private = KeypairBytes { secret_key, public_key: None }.to_pkcs8_pem(LineEnding::LF);
    let private = private.map_err(|error| miette!("{error}"))?;
    let pem = key.to_public_key_pem(LineEnding::LF).into_diagnostic()?;
    files::write_pair((path, &private), (&public, &pem))?;
    Ok(Pair { public, pem, fingerprint: Fingerprint::of(&key) })
}

/// Reads the private key of a pair.
///
/// # Errors
/// Returns an error if the file cannot be read or does not contain a private Ed25519 key.
pub fn private_key(path: &Path) -> miette::Result<SigningKey> {
    let text = files::read_text(path, Kind::PrivateKey)?;
    let key = SigningKey::from_pkcs8_pem(&text).map_err(|_| {
        let help = match text.contains("PUBLIC KEY") {
            true => "give the private key of the pair: this file is a public key",
            false => {
                "make a private key with `rollwalk keys new-pair KEY.pem` or `openssl genpkey \
                -algorithm ed25519`"
            }
        };
        miette!(
            help = help,
            "{} is not a private Ed25519 key in PEM format (PKCS #8)",
            path.display()
        )
    })?;
    // Only a private key must be unreadable for others.
    warn_if_readable_by_others(path);
    Ok(key)
}

/// Reads the public key of a pair.
///
/// # Errors
/// Returns an error if the file cannot be read or does not contain a public Ed25519 key.
pub fn public_key(path: &Path) -> miette::Result<VerifyingKey> {
    let text = files::read_text(path, Kind::PublicKey)?;
    let key = VerifyingKey::from_public_key_pem(&text).ok().filter(|key| !key.is_weak());
    key.ok_or_else(|| {
        let help = match text.contains("PRIVATE KEY") {
            true => {
                "give the public key of the pair, such as KEY.pub.pem: this file is a private key"
            }
            false => {
                "make a key pair with `rollwalk keys new-pair KEY.pem`; the public key is \
                KEY.pub.pem"
            }
        };
        miette!(help = help, "{} is not a public Ed25519 key in PEM format", path.display())
    })
}

/// Appends a signature to a library.
pub fn signed(library: &[u8], key: &SigningKey) -> Vec<u8> {
    let fingerprint = Fingerprint::of(&key.verifying_key());
    let mut file = [library, &signature_head(fingerprint.0)].concat();
    let signature = key.sign(&file);
    file.extend(signature.to_bytes());
    file
}

/// Fingerprint of the key that a file claims as its signer.
pub fn signer(file: &[u8]) -> Option<Fingerprint> {
    SignedFile::split(file).map(|file| Fingerprint(file.fingerprint))
}

/// Problem of a signature; messages begin with the name of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unsigned {
    #[error("is not signed")]
    Missing,
    /// Signature by another key.
    #[error("is signed with key {theirs}, not with {ours}")]
    Others {
        /// Fingerprint of the key that the file claims.
        theirs: Fingerprint,
        /// Fingerprint of the expected key.
        ours: Fingerprint,
    },
    /// Signature by the expected key, but for other content.
    #[error("was changed after it was signed with key {ours}, or its signature was changed")]
    Changed { ours: Fingerprint },
}

impl Unsigned {
    pub fn help(self) -> &'static str {
        match self {
            Self::Missing => {
                "sign the library with the private key of the pair: `rollwalk library sign LIB.rwl \
                 --key KEY.pem -o SIGNED.rwl`"
            }
            Self::Others { .. } => {
                "give the public key of the signer, or sign the library with your own private key: \
                 `rollwalk library sign LIB.rwl --key KEY.pem -o SIGNED.rwl`"
            }
            Self::Changed { .. } => "get the library again from its signer",
        }
    }
}

/// Verifies a file's signature as a controller with `key` does.
///
/// # Errors
/// Returns an error if the file is not signed, was signed with another key, or was changed.
pub fn check(file: &[u8], key: &VerifyingKey) -> Result<(), Unsigned> {
    let ours = Fingerprint::of(key);
    let file = SignedFile::split(file).ok_or(Unsigned::Missing)?;
    let theirs = Fingerprint(file.fingerprint);
    match key.verify_strict(file.message, &Signature::from_bytes(file.signature)) {
        Ok(()) => Ok(()),
        Err(_) if theirs == ours => Err(Unsigned::Changed { ours }),
        Err(_) => Err(Unsigned::Others { theirs, ours }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_pair_is_made_once_and_its_private_key_for_its_user_alone() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let made = new_pair(&at("owner.pem")).unwrap();
        assert_eq!(made.public, at("owner.pub.pem"));
        assert_eq!(fs::read_to_string(&made.public).unwrap(), made.pem);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(fs::metadata(at("owner.pem")).unwrap().permissions().mode() & 0o777, 0o600);
        }
        let private = private_key(&at("owner.pem")).unwrap();
        let public = public_key(&made.public).unwrap();
        assert_eq!(private.verifying_key(), public);
        assert_eq!(Fingerprint::of(&public), made.fingerprint);
        // No file of the pair is overwritten, and no file is made alone.
        fs::remove_file(at("owner.pem")).unwrap();
        assert!(new_pair(&at("owner.pem")).err().unwrap().to_string().contains("exists"));
        assert!(!at("owner.pem").exists());
        fs::rename(&made.public, at("owner.pem")).unwrap();
        assert!(new_pair(&at("owner.pem")).err().unwrap().to_string().contains("exists"));
        assert!(!made.public.exists());
        assert_eq!(new_pair(&at("plain")).unwrap().public, at("plain.pub"));
    }

    /// Checks that a private key is never written to a file with the name of a public key, which users give to others.
    #[test]
    fn no_private_key_is_called_public() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.pub.pem", "a.pub", "a.PUB.pem"] {
            let path = folder.path().join(name);
            let error = new_pair(&path).err().unwrap().to_string();
            assert!(error.contains("is the file name of a public key"), "{error}");
            assert!(!path.exists());
        }
        assert!(fs::read_dir(folder.path()).unwrap().next().is_none());
    }

    /// Keys written by `openssl genpkey -algorithm ed25519` and `openssl pkey -pubout`, with the fingerprint from `sha256sum`.
    #[test]
    fn keys_of_openssl() {
        let folder = tempfile::tempdir().unwrap();
        let [private, public] = ["k.pem", "p.pem"].map(|name| folder.path().join(name));
        let pem = "-----BEGIN PRIVATE KEY-----\n\
                   MC4CAQAwBQYDK2VwBCIEIAEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEB\n\
                   -----END PRIVATE KEY-----\n";
        fs::write(&private, pem).unwrap();
        let pem = "-----BEGIN PUBLIC KEY-----\n\
                   MCowBQYDK2VwAyEAiojj3XQJ8ZX9UtstPLpdcspnCb8dlBIb83SIAbQPb1w=\n\
                   -----END PUBLIC KEY-----\n";
        fs::write(&public, pem).unwrap();
        let key = private_key(&private).unwrap();
        assert_eq!(key.to_bytes(), [1; 32]);
        assert_eq!(key.verifying_key(), public_key(&public).unwrap());
        assert_eq!(Fingerprint::of(&key.verifying_key()).to_string(), "fd110d301d2f077d");

        let error = private_key(&public).unwrap_err();
        assert!(format!("{error:?}").contains("file is a public key"), "{error:?}");
        let error = public_key(&private).unwrap_err();
        assert!(format!("{error:?}").contains("this file is a\n        private key"), "{error:?}");
        fs::write(&private, "x").unwrap();
        assert!(private_key(&private).is_err() && public_key(&private).is_err());
    }

    #[test]
    fn a_signature_is_for_one_key_and_one_library() {
        let [ours, theirs] = [1, 2].map(|seed| SigningKey::from_bytes(&[seed; 32]));
        let key = ours.verifying_key();
        let file = signed(b"library", &ours);
        assert_eq!(signer(&file), Some(Fingerprint::of(&key)));
        assert_eq!(check(&file, &key), Ok(()));
        assert_eq!(check(b"library", &key), Err(Unsigned::Missing));
        let error = check(&signed(b"library", &theirs), &key).unwrap_err();
        assert!(error.to_string().contains("is signed with key"), "{error}");
        for at in 0..file.len() {
            let mut changed = file.clone();
            changed[at] ^= 1;
            assert!(check(&changed, &key).is_err(), "byte {at}");
        }
    }
}
