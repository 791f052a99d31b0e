//! Tests of the flash store on a simulated flash.

extern crate std;

mod behaviour;
pub(crate) mod nor;
mod parameters;
mod power_cuts;
mod random_flash;

use std::vec::Vec;

use rollwalk_protocol::config::{Channel, ChannelKind, RobotConfig};
use rollwalk_protocol::crc::file_digest;
use rollwalk_protocol::library::{LibrarySpec, MotionSpec, encode, validate};

use super::*;

/// Number of boots after which a trial ends.
const TRIAL_BOOTS: u8 = 3;

/// Configuration of a robot with one joint.
pub(crate) fn config() -> RobotConfig {
    let joint = Channel {
        kind: ChannelKind::JointPosition,
        min: -1.0,
        max: 1.0,
        max_rate: 5.0,
        max_torque_nm: 3.0,
        kp_nm_rad: 20.0,
        kd_nm_s_rad: 0.5,
        bus: 0,
        id: 1,
    };
    RobotConfig { robot: 0, channels: [joint].into_iter().collect() }
}

/// Builds a valid library of one motion, which differs for each `seed`.
fn library(seed: u32, frames: usize) -> Vec<u8> {
    let config = config();
    let mut random = seed;
    let frames: Vec<f32> = (0..frames)
        .map(|_| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            0.04 * ((random >> 16) as f32 / 65536.0)
        })
        .collect();
    let motions =
        [MotionSpec { name: "settle", code: 1, looping: false, frames: &frames, torques: &[] }];
    let spec = LibrarySpec { config: &config, motions: &motions, transitions: &[], safe: 0 };
    let mut bytes = std::vec![0; 1 << 16];
    let len = encode(&spec, &mut bytes).unwrap();
    bytes.truncate(len);
    assert!(validate(&bytes, &config).is_ok());
    bytes
}

/// Sends a library like the transfer service, in blocks that are a multiple of neither word nor unit.
fn send<F: MappedFlash>(store: &mut FlashStore<F>, library: &[u8]) -> Result<(), StoreError> {
    let mut at = store.begin(library.len(), file_digest(library))?;
    while at < library.len() {
        let end = library.len().min(at + 77);
        store.write(at, &library[at..end])?;
        at = end;
    }
    store.seal()?;
    assert_eq!(store.received(), library);
    Ok(())
}

/// Creates a store in `flash` with `library` confirmed.
fn holding<F: MappedFlash>(flash: F, library: &[u8]) -> FlashStore<F> {
    let mut store = FlashStore::mount(flash, TRIAL_BOOTS).unwrap();
    send(&mut store, library).unwrap();
    store.activate().unwrap();
    store.confirm().unwrap();
    store
}
