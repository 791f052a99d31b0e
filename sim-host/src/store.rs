//! The controller's library memory, simulated: the store of a real board, in flash made of RAM.

use rollwalk_firmware::store::{FlashStore, RamFlash};

/// The flash, bytes: two libraries of up to 1 MiB, and the store's log.
const CAPACITY: usize = (2 << 20) + (8 << 10);
/// Starts that a library on trial is given.
const TRIAL_BOOTS: u8 = 3;

/// What the simulated controller keeps libraries in.
pub type SimStore = FlashStore<RamFlash<Vec<u8>>>;

/// A store as it leaves the factory.
pub fn blank() -> SimStore {
    FlashStore::mount(RamFlash::new(vec![0xFF; CAPACITY]), TRIAL_BOOTS)
        .expect("the capacity is made of whole erase units")
}
