//! Keys in the image of a board: a block of bytes that is blank in the compiled program.
//!
//! `cargo xtask image` writes the keys into the compiled image, so that no key passes through a compiler, its command line or
//! its caches.
//!
//! ```text
//! 0   magic     RW-KEYS1
//! 8   keys u32  bit 0: link key present, bit 1: library key present
//! 12  link key, 32 bytes; zeros if absent
//! 44  library key, 32 bytes; zeros if absent
//! 76  CRC-32C u32 of bytes 0 to 75; invalid in a blank block
//! ```

use rollwalk_protocol::crc::crc32c;

/// Length of a key, bytes.
pub const KEY_LEN: usize = 32;
/// Length of a block, bytes.
pub const LEN: usize = 12 + 2 * KEY_LEN + 4;

const MAGIC: [u8; 8] = *b"RW-KEYS1";
const HAS_LINK: u32 = 1;
const HAS_LIBRARY: u32 = 2;

/// Block of a program without keys written into it.
pub const BLANK: [u8; LEN] = {
    let mut block = [0; LEN];
    let mut at = 0;
    while at < MAGIC.len() {
        block[at] = MAGIC[at];
        at += 1;
    }
    block
};

/// Keys of an image.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Keys {
    /// Secret that the robot shares with its hosts.
    pub link: Option<[u8; KEY_LEN]>,
    /// Public key for the signatures of motion libraries.
    pub library: Option<[u8; KEY_LEN]>,
}

impl Keys {
    /// Encodes the keys as a block.
    pub fn encode(&self) -> [u8; LEN] {
        let has = |key: &Option<_>, bit| if key.is_some() { bit } else { 0 };
        let keys = has(&self.link, HAS_LINK) | has(&self.library, HAS_LIBRARY);
        let [link, library] = [self.link, self.library].map(Option::unwrap_or_default);
        let bytes = MAGIC.into_iter().chain(keys.to_le_bytes()).chain(link).chain(library);
        let mut block = [0; LEN];
        block.iter_mut().zip(bytes).for_each(|(place, byte)| *place = byte);
        if let Some((body, crc)) = block.split_last_chunk_mut::<4>() {
            *crc = crc32c(body).to_le_bytes();
        }
        block
    }

    /// Decodes the keys of a block; `None` if the block is blank, damaged or of another version.
    pub fn decode(block: &[u8; LEN]) -> Option<Self> {
        let (body, crc) = block.split_last_chunk::<4>()?;
        if crc32c(body).to_le_bytes() != *crc {
            return None;
        }
        let (keys, rest) = body.strip_prefix(&MAGIC)?.split_first_chunk::<4>()?;
        let (link, rest) = rest.split_first_chunk::<KEY_LEN>()?;
        let library = rest.first_chunk::<KEY_LEN>()?;
        let keys = u32::from_le_bytes(*keys);
        let known = keys & !(HAS_LINK | HAS_LIBRARY) == 0;
        known.then_some(Self {
            link: (keys & HAS_LINK != 0).then_some(*link),
            library: (keys & HAS_LIBRARY != 0).then_some(*library),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn golden_bytes() {
        let keys = Keys { link: Some([0x11; KEY_LEN]), library: Some([0x22; KEY_LEN]) };
        let block = keys.encode();
        assert_eq!(block[..12], *b"RW-KEYS1\x03\0\0\0");
        assert_eq!(block[12..44], [0x11; KEY_LEN]);
        assert_eq!(block[44..76], [0x22; KEY_LEN]);
        assert_eq!(block[76..], crc32c(&block[..76]).to_le_bytes());
    }

    #[test]
    fn blocks_hold_the_keys_that_there_are() {
        let [link, library] = [3, 4].map(|byte| [byte; KEY_LEN]);
        for keys in [
            Keys::default(),
            Keys { link: Some(link), library: None },
            Keys { link: None, library: Some(library) },
            Keys { link: Some(link), library: Some(library) },
        ] {
            assert!(Keys::decode(&keys.encode()) == Some(keys));
        }
    }

    /// A blank or damaged block must not decode as a block without keys, which would run unprotected.
    #[test]
    fn blank_and_damaged_blocks_have_no_keys_to_run_with() {
        assert!(BLANK.starts_with(&MAGIC) && Keys::decode(&BLANK).is_none());
        let block = Keys { link: Some([5; KEY_LEN]), library: None }.encode();
        for bit in 0..8 * LEN {
            let mut damaged = block;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(Keys::decode(&damaged).is_none(), "bit {bit}");
        }
        let mut later = block;
        later[8] |= 4;
        let crc = crc32c(&later[..LEN - 4]).to_le_bytes();
        later[LEN - 4..].copy_from_slice(&crc);
        assert!(Keys::decode(&later).is_none(), "a key that this version does not know");
    }
}
