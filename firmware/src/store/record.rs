//! Persistent state of the store in 32 bytes: the record of the [log](super::log), and the slot's footer.
//!
//! A record contains the whole state, so the newest record alone is decisive, and writing one is the commit. 32 bytes are the
//! largest write unit in use (the flash word of an STM32H7). Integers are little-endian.
//!
//! | offset | field of a record | content |
//! |---|---|---|
//! | 0 | generation `u32` | the highest valid generation in the log counts |
//! | 4 | magic `u8` | `A7` |
//! | 5 | slots `u8` | low half: confirmed library, 0 none, 1 A, 2 B; high half: candidate, 0 none, 1 receiving, 2 trial |
//! | 6 | boots left `u8` | boots left of a trial |
//! | 7 | reserved `u8` | 0 |
//! | 8 | length, digest: two `u32` | confirmed library |
//! | 16 | length, digest: two `u32` | candidate |
//! | 24 | have `u32` | number of the candidate's bytes in flash |
//! | 28 | CRC-32C `u32` | of bytes 0 to 27 |
//!
//! The candidate is in the slot without the confirmed library; without a confirmed library, in slot A. The footer is at the end
//! of a slot, behind the place of a spare footer. The store writes it when it confirms the library of the slot, and erases it
//! before any other write to the slot.
//!
//! | offset | field of a footer | content |
//! |---|---|---|
//! | 0 | magic, 8 bytes | `RW-SLOT1` |
//! | 8 | generation `u32` | that of the record that confirmed the library |
//! | 12 | length, digest: two `u32` | library |
//! | 20 | reserved, 8 bytes | 0 |
//! | 28 | CRC-32C `u32` | of bytes 0 to 27 |

use rollwalk_protocol::crc::crc32c;

/// Length of a record and of a footer, bytes.
pub(super) const RECORD_LEN: usize = 32;

const MAGIC: u8 = 0xA7;
const FOOTER_MAGIC: [u8; 8] = *b"RW-SLOT1";

/// Content of a log, in records of `N` bytes: a multiple of the flash's word length.
pub(super) trait Record<const N: usize>: Sized {
    /// Encodes a record with generation `generation`.
    fn encode(&self, generation: u32) -> [u8; N];

    /// Decodes generation and content of a record; `None` if the bytes are not a valid record.
    fn decode(bytes: &[u8; N]) -> Option<(u32, Self)>;
}

/// Slot for a library, one of two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slot {
    A,
    B,
}

impl Slot {
    pub const ALL: [Slot; 2] = [Slot::A, Slot::B];

    pub fn other(self) -> Slot {
        match self {
            Slot::A => Slot::B,
            Slot::B => Slot::A,
        }
    }
}

/// Slot, length and digest of a library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Image {
    pub slot: Slot,
    pub len: u32,
    pub digest: u32,
}

/// Content of the slot that does not contain the confirmed library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Candidate {
    /// Empty or useless content.
    None,
    /// Library being received, with its first `have` bytes stored.
    Receiving { len: u32, digest: u32, have: u32 },
    /// Library on trial, rolled back to the confirmed one after `boots_left` more boots.
    Trial { len: u32, digest: u32, boots_left: u8 },
}

/// State of the store that must survive a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct StoreState {
    pub confirmed: Option<Image>,
    pub candidate: Candidate,
}

impl StoreState {
    /// Slot of a candidate: the slot without the confirmed library.
    pub fn candidate_slot(&self) -> Slot {
        self.confirmed.map_or(Slot::A, |image| image.slot.other())
    }

    /// Image of the candidate; `None` if the candidate is not complete.
    pub fn candidate_image(&self) -> Option<Image> {
        let slot = self.candidate_slot();
        match self.candidate {
            Candidate::Receiving { len, digest, have } if have == len => {
                Some(Image { slot, len, digest })
            }
            Candidate::Trial { len, digest, .. } => Some(Image { slot, len, digest }),
            _ => None,
        }
    }
}

impl Record<RECORD_LEN> for StoreState {
    fn encode(&self, generation: u32) -> [u8; RECORD_LEN] {
        let slot = match self.confirmed {
            None => 0,
            Some(Image { slot: Slot::A, .. }) => 1,
            Some(Image { slot: Slot::B, .. }) => 2,
        };
        let confirmed = self.confirmed.map_or((0, 0), |image| (image.len, image.digest));
        let (kind, boots_left, len, digest, have) = match self.candidate {
            Candidate::None => (0, 0, 0, 0, 0),
            Candidate::Receiving { len, digest, have } => (1, 0, len, digest, have),
            Candidate::Trial { len, digest, boots_left } => (2, boots_left, len, digest, len),
        };
        let head = u32::from_le_bytes([MAGIC, slot | kind << 4, boots_left, 0]);
        sealed([generation, head, confirmed.0, confirmed.1, len, digest, have])
    }

    fn decode(bytes: &[u8; RECORD_LEN]) -> Option<(u32, StoreState)> {
        let [generation, head, confirmed_len, confirmed_digest, len, digest, have] = opened(bytes)?;
        let [MAGIC, kinds, boots_left, 0] = head.to_le_bytes() else { return None };
        let confirmed = |slot| Some(Image { slot, len: confirmed_len, digest: confirmed_digest });
        let confirmed = match kinds & 0xF {
            0 => None,
            1 => confirmed(Slot::A),
            2 => confirmed(Slot::B),
            _ => return None,
        };
        let candidate = match kinds >> 4 {
            0 => Candidate::None,
            1 if have <= len => Candidate::Receiving { len, digest, have },
            2 => Candidate::Trial { len, digest, boots_left },
            _ => return None,
        };
        Some((generation, StoreState { confirmed, candidate }))
    }
}

/// Mark at the end of a slot whose library was confirmed. The store recovers from it if the log is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Footer {
    /// Generation of the record that confirmed the library. The highest is the newest.
    pub generation: u32,
    pub len: u32,
    pub digest: u32,
}

impl Footer {
    pub fn encode(&self) -> [u8; RECORD_LEN] {
        let [a, b, c, d, e, f, g, h] = FOOTER_MAGIC;
        let magic = [u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h])];
        sealed([magic[0], magic[1], self.generation, self.len, self.digest, 0, 0])
    }

    pub fn decode(bytes: &[u8; RECORD_LEN]) -> Option<Footer> {
        let [_, _, generation, len, digest, 0, 0] = opened(bytes)? else { return None };
        bytes.starts_with(&FOOTER_MAGIC).then_some(Footer { generation, len, digest })
    }
}

/// True if the bytes are in the erased state.
pub(super) fn is_blank(bytes: &[u8]) -> bool {
    bytes.iter().all(|&byte| byte == 0xFF)
}

/// Encodes seven words and their CRC.
fn sealed(words: [u32; 7]) -> [u8; RECORD_LEN] {
    let mut bytes = [0; RECORD_LEN];
    for (place, word) in bytes.chunks_exact_mut(4).zip(words) {
        place.copy_from_slice(&word.to_le_bytes());
    }
    if let Some((body, crc)) = bytes.split_last_chunk_mut::<4>() {
        *crc = crc32c(body).to_le_bytes();
    }
    bytes
}

/// Decodes seven words; `None` if the CRC does not match.
fn opened(bytes: &[u8; RECORD_LEN]) -> Option<[u32; 7]> {
    let (body, crc) = bytes.split_last_chunk::<4>()?;
    let mut words = [0; 7];
    for (word, place) in words.iter_mut().zip(body.as_chunks::<4>().0) {
        *word = u32::from_le_bytes(*place);
    }
    (crc32c(body).to_le_bytes() == *crc).then_some(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn golden_bytes() {
        let state = StoreState {
            confirmed: Some(Image { slot: Slot::B, len: 0x1234, digest: 0xDEAD_BEEF }),
            candidate: Candidate::Trial { len: 0x5678, digest: 0x0102_0304, boots_left: 3 },
        };
        let bytes = state.encode(9);
        assert_eq!(
            bytes[..28],
            [
                9, 0, 0, 0, 0xA7, 0x22, 3, 0, 0x34, 0x12, 0, 0, 0xEF, 0xBE, 0xAD, 0xDE, 0x78, 0x56,
                0, 0, 4, 3, 2, 1, 0x78, 0x56, 0, 0
            ]
        );
        assert_eq!(bytes[28..], crc32c(&bytes[..28]).to_le_bytes());
        assert_eq!(StoreState::decode(&bytes), Some((9, state)));

        let footer = Footer { generation: 7, len: 0x1234, digest: 0xDEAD_BEEF };
        let bytes = footer.encode();
        assert_eq!(bytes[..16], *b"RW-SLOT1\x07\0\0\0\x34\x12\0\0");
        assert_eq!(Footer::decode(&bytes), Some(footer));
        assert_eq!(StoreState::decode(&bytes), None);
    }

    #[test]
    fn states_survive_and_no_single_flipped_bit_does() {
        let image = |slot| Image { slot, len: 300, digest: 5 };
        for confirmed in [None, Some(image(Slot::A)), Some(image(Slot::B))] {
            for candidate in [
                Candidate::None,
                Candidate::Receiving { len: 400, digest: 6, have: 256 },
                Candidate::Trial { len: 400, digest: 6, boots_left: 0 },
            ] {
                let state = StoreState { confirmed, candidate };
                let bytes = state.encode(u32::MAX);
                assert_eq!(StoreState::decode(&bytes), Some((u32::MAX, state)));
                for bit in 0..8 * RECORD_LEN {
                    let mut damaged = bytes;
                    damaged[bit / 8] ^= 1 << (bit % 8);
                    assert_eq!(StoreState::decode(&damaged), None);
                }
            }
        }
        let candidate = Candidate::Receiving { len: 400, digest: 6, have: 401 };
        assert_eq!(StoreState::decode(&StoreState { confirmed: None, candidate }.encode(1)), None);
        assert_eq!(StoreState::decode(&[0; RECORD_LEN]), None);
        assert_eq!(StoreState::decode(&[0xFF; RECORD_LEN]), None);
    }
}
