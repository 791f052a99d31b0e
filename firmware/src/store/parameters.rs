//! Gains and limits that survive a power cycle.
//!
//! A set is one record of a separate [log](super::log). After an interrupted write, either the previous set or the new one is
//! there, never a mixture. A record has 320 bytes for a robot with up to 24 channels, little-endian:
//!
//! | offset | field | value |
//! |---|---|---|
//! | 0 | generation u32 | the highest valid generation in the log counts |
//! | 4 | magic u8 | `B3` |
//! | 5 | parameters u8 | 3 for each channel |
//! | 6 | channels u8 | 0 to 24 |
//! | 7 | robot values u8 | 1 if feed-forward follows the channels; 0 if feed-forward is 1.0 |
//! | 8 | configuration u32 | hash |
//! | 12 | values f32 | kp, kd, torque limit of each channel, then feed-forward if present; then 0 |
//! | 316 | CRC-32C u32 | of bytes 0 to 315 |
//!
//! Records of larger robots have 800 bytes: up to 64 channels, and the CRC at offset 796.

use embedded_storage::nor_flash::NorFlash;
use heapless::Vec;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_protocol::crc::crc32c;
use rollwalk_protocol::wire::Parameter;

use super::log::Log;
use super::record::{RECORD_LEN, Record};
use super::{GeometryError, StoreError};

/// Number of parameters of a channel.
pub(crate) const PARAMETERS: usize = Parameter::MaxTorque as usize + 1;

/// Length of the longest set, bytes; see [`set_len`].
pub const SET_LEN: usize = set_len(MAX_CHANNELS);
const SHORT_CHANNELS: usize = 24;
const LONG_CHANNELS: usize = 64;
const MAGIC: u8 = 0xB3;

/// Length of the sets of a robot with the given number of channels, bytes: 320 for up to 24 channels, 800 for more. A set
/// consists of head, values, checksum, and padding to a multiple of 32 bytes, the largest write unit in use.
pub const fn set_len(channels: usize) -> usize {
    let channels = if channels <= SHORT_CHANNELS { SHORT_CHANNELS } else { LONG_CHANNELS };
    // Saturates for the compiler, which checks the arithmetic of the firmware.
    let (head, tail) = (12, 8);
    let values = channels.saturating_mul(4 * PARAMETERS);
    values.saturating_add(head + tail).next_multiple_of(RECORD_LEN)
}

/// Parameters of all channels and of the robot, and the configuration that they belong to.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterSet {
    /// Hash of the configuration ([`rollwalk_protocol::config::RobotConfig::hash`]).
    pub config_hash: u32,
    /// Values of each channel, in the order of [`Parameter::ALL`].
    pub values: Vec<[f32; PARAMETERS], MAX_CHANNELS>,
    /// Value of [`Parameter::FeedForward`].
    pub feed_forward: f32,
}

/// Memory for one [`ParameterSet`].
pub trait ParameterStore {
    /// Set that was saved most recently; `None` if no set was saved.
    fn load(&mut self) -> Option<ParameterSet>;

    /// Replaces the saved set; an error leaves the previous one in place.
    fn save(&mut self, set: &ParameterSet) -> Result<(), StoreError>;
}

/// Absent store: nothing can be saved.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoParameters;

impl ParameterStore for NoParameters {
    fn load(&mut self) -> Option<ParameterSet> {
        None
    }

    fn save(&mut self, _: &ParameterSet) -> Result<(), StoreError> {
        Err(StoreError::OutOfRange)
    }
}

/// Parameter store in NOR flash, which need not be mapped, with sets of `LEN` bytes: [`set_len`] of the robot's channels.
#[derive(Debug)]
pub struct FlashParameters<F, const LEN: usize = SET_LEN> {
    pub(super) flash: F,
    pub(super) log: Log,
}

impl<F: NorFlash, const LEN: usize> FlashParameters<F, LEN> {
    /// Finds the saved set after a reset.
    ///
    /// All of `flash` belongs to the store: at least three units of `LEN` bytes, each rounded up to whole erase units.
    pub fn mount(mut flash: F) -> Result<Self, GeometryError> {
        let (log, _) = Log::mount::<LEN, ParameterSet, F>(&mut flash)?;
        Ok(Self { flash, log })
    }

    /// Returns the flash.
    pub fn into_flash(self) -> F {
        self.flash
    }
}

impl<F: NorFlash, const LEN: usize> ParameterStore for FlashParameters<F, LEN> {
    fn load(&mut self) -> Option<ParameterSet> {
        let (log, set) = Log::mount::<LEN, ParameterSet, F>(&mut self.flash).ok()?;
        self.log = log;
        set
    }

    fn save(&mut self, set: &ParameterSet) -> Result<(), StoreError> {
        if set_len(set.values.len()) > LEN {
            return Err(StoreError::OutOfRange);
        }
        self.log.append::<LEN, F>(&mut self.flash, set)
    }
}

impl<const LEN: usize> Record<LEN> for ParameterSet {
    fn encode(&self, generation: u32) -> [u8; LEN] {
        // Firmware that does not know `feed_forward` reads a set in which it is 1.
        let has_feed_forward = self.feed_forward != 1.0;
        let head = [MAGIC, PARAMETERS as u8, self.values.len() as u8, u8::from(has_feed_forward)];
        let words = [generation, u32::from_le_bytes(head), self.config_hash];
        let feed_forward = has_feed_forward.then_some(&self.feed_forward);
        let values = self.values.iter().flatten().chain(feed_forward).map(|value| value.to_bits());
        let mut bytes = [0; LEN];
        for (place, word) in bytes.chunks_exact_mut(4).zip(words.into_iter().chain(values)) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        if let Some((body, crc)) = bytes.split_last_chunk_mut::<4>() {
            *crc = crc32c(body).to_le_bytes();
        }
        bytes
    }

    fn decode(bytes: &[u8; LEN]) -> Option<(u32, Self)> {
        let (body, crc) = bytes.split_last_chunk::<4>()?;
        if crc32c(body).to_le_bytes() != *crc {
            return None;
        }
        let mut words = body.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word));
        let generation = words.next()?;
        let [MAGIC, parameters, channels, of_robot @ 0..=1] = words.next()?.to_le_bytes() else {
            return None;
        };
        if usize::from(parameters) != PARAMETERS || usize::from(channels) > MAX_CHANNELS {
            return None;
        }
        let config_hash = words.next()?;
        let mut values = Vec::new();
        for _ in 0..channels {
            let mut of_channel = [0.0; PARAMETERS];
            for value in &mut of_channel {
                *value = f32::from_bits(words.next()?);
            }
            values.push(of_channel).ok()?;
        }
        let feed_forward = if of_robot == 1 { f32::from_bits(words.next()?) } else { 1.0 };
        Some((generation, Self { config_hash, values, feed_forward }))
    }
}
