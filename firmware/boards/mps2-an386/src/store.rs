//! The library store and the count of boots, in PSRAM that stands for flash: the emulator has no model of NOR flash.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, Ordering};
use rollwalk_firmware::store::{FlashStore, RamFlash};

/// Size of the library flash, bytes, equal to that of the host's simulation: a controller reports it, and both must report the
/// same.
pub const CAPACITY: usize = (2 << 20) + (8 << 10);
/// Starts that a library on trial is given.
const TRIAL_BOOTS: u8 = 3;

/// Three erase units for the count of boots.
const BOOTS: usize = 12 << 10;

pub type Flash<const N: usize> = RamFlash<&'static mut [u8; N]>;
/// The board's store of libraries.
pub type Libraries = FlashStore<Flash<CAPACITY>>;

/// The stores, which are taken once.
pub struct Stores {
    /// Store with the libraries in memory.
    pub libraries: Libraries,
    /// Flash for the count of boots. Here it is lost when the emulator ends.
        pub boots: Flash<BOOTS>,
}

struct Psram<const N: usize>(UnsafeCell<[u8; N]>);

// SAFETY: `mount` hands out the only references, once.
unsafe impl<const N: usize> Sync for Psram<N> {}

/// The start-up code neither clears nor fills it. Every value of a byte is one.
#[unsafe(link_section = ".library")]
static LIBRARIES: Psram<CAPACITY> = Psram(UnsafeCell::new([0; CAPACITY]));
#[unsafe(link_section = ".library")]
static COUNT: Psram<BOOTS> = Psram(UnsafeCell::new([0; BOOTS]));
static TAKEN: AtomicBool = AtomicBool::new(false);

/// Mounts the stores; the first time only.
pub fn mount() -> Option<Stores> {
    if TAKEN.swap(true, Ordering::AcqRel) {
        return None;
    }
    // SAFETY: the flag lets one caller through.
    let (libraries, boots) = unsafe { (&mut *LIBRARIES.0.get(), &mut *COUNT.0.get()) };
    let libraries = FlashStore::mount(RamFlash::new(libraries), TRIAL_BOOTS).ok()?;
    Some(Stores { libraries, boots: RamFlash::new(boots) })
}
