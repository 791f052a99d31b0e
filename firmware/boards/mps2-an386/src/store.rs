//! The library store, in PSRAM that stands for flash: the emulator has no model of NOR flash.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, Ordering};
use rollwalk_firmware::store::{FlashStore, RamFlash};

/// As large as that of the host's simulation: a controller reports it, and both must report the same.
const CAPACITY: usize = (2 << 20) + (8 << 10);
/// Starts that a library on trial is given.
const TRIAL_BOOTS: u8 = 3;

type Libraries = FlashStore<RamFlash<&'static mut [u8; CAPACITY]>>;

/// The board's store of libraries.
#[cfg(not(feature = "signed"))]
pub type BoardStore = Libraries;
/// The board's store of signed libraries.
#[cfg(feature = "signed")]
pub type BoardStore = rollwalk_firmware::store::Signed<Libraries>;

struct Psram(UnsafeCell<[u8; CAPACITY]>);

// SAFETY: `mount` hands out the only reference, once.
unsafe impl Sync for Psram {}

/// The start-up code neither clears nor fills it. Every value of a byte is one.
#[unsafe(link_section = ".library")]
static PSRAM: Psram = Psram(UnsafeCell::new([0; CAPACITY]));
static TAKEN: AtomicBool = AtomicBool::new(false);

/// Mounts the store with the libraries in memory; the first time only.
pub fn mount() -> Option<BoardStore> {
    if TAKEN.swap(true, Ordering::AcqRel) {
        return None;
    }
    // SAFETY: the flag lets one caller through.
    let memory = unsafe { &mut *PSRAM.0.get() };
    let store = FlashStore::mount(RamFlash::new(memory), TRIAL_BOOTS).ok()?;
    #[cfg(feature = "signed")]
    let store = BoardStore::new(store, crate::public_keys::library()?);
    Some(store)
}
