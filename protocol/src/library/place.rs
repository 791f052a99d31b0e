//! Places of motions. A motion for a terrain begins at one place of the world, which its name in the library states after an @,
//! as in `climb@stairs`. A controller plays it only if the host confirms that the robot stands there.

use crate::crc::crc32c;
use core::num::NonZeroU16;

/// Code of a place on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlaceCode(NonZeroU16);

impl PlaceCode {
    /// Code of a place with this name: the low half of its CRC-32C, or 1 if that is 0.
    pub fn named(place: &str) -> Self {
        Self::of_bytes(place.as_bytes())
    }

    /// Place of a motion with this name; `None` for a motion that may begin anywhere.
    pub fn of_motion(name: &str) -> Option<Self> {
        place_in(name.as_bytes()).map(Self::of_bytes)
    }

    fn of_bytes(place: &[u8]) -> Self {
        Self(NonZeroU16::new(crc32c(place) as u16).unwrap_or(NonZeroU16::MIN))
    }

    /// Place with a code on the wire; `None` for 0.
    pub fn from_code(code: u16) -> Option<Self> {
        NonZeroU16::new(code).map(Self)
    }

    /// Code on the wire.
    pub fn code(self) -> u16 {
        self.0.get()
    }
}

/// Name of the place in the name of a motion; `None` without one.
pub fn place_of(motion: &str) -> Option<&str> {
    let place = place_in(motion.as_bytes())?;
    motion.get(motion.len().saturating_sub(place.len())..)
}

/// Bytes of the name of the place. Text takes more of a controller's memory than bytes.
fn place_in(motion: &[u8]) -> Option<&[u8]> {
    let at = motion.iter().position(|byte| *byte == b'@').filter(|at| *at > 0)?;
    motion.get(at.saturating_add(1)..).filter(|place| !place.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_follows_the_name_of_its_motion() {
        assert_eq!(place_of("climb@stairs"), Some("stairs"));
        assert_eq!(place_of("climb@stairs@home"), Some("stairs@home"));
        for name in ["climb", "climb@", "@stairs", ""] {
            assert_eq!(place_of(name), None, "{name}");
        }
        assert_eq!(PlaceCode::of_motion("climb@stairs"), Some(PlaceCode::named("stairs")));
        assert_ne!(PlaceCode::named("stairs"), PlaceCode::named("kerb"));
    }

    /// Codes on the wire, which must not change.
    #[test]
    fn codes_are_pinned() {
        // CRC-32C of the digits 1 to 9 is E3069283.
        assert_eq!(PlaceCode::named("123456789").code(), 0x9283);
        assert_eq!(PlaceCode::from_code(0), None);
        assert_eq!(PlaceCode::from_code(0x9283), Some(PlaceCode::named("123456789")));
    }
}
