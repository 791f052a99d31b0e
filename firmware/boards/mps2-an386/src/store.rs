//! Library store and boot counter, in PSRAM that stands in for flash: the emulator has no model of NOR flash.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, Ordering};
use rollwalk_firmware::store::{FlashStore, RamFlash};

/// Size of the library flash, bytes. It must equal that of the simulated controller on a host, because the controller reports
/// it.
pub const CAPACITY: usize = (2 << 20) + (8 << 10);
/// Number of boots after which a library on trial is rolled back.
const TRIAL_BOOTS: u8 = 3;

/// Size of the boot counter's flash, bytes: three erase units.
const BOOTS: usize = 12 << 10;

pub type Flash<const N: usize> = RamFlash<&'static mut [u8; N]>;
/// Library store of the board.
pub type Libraries = FlashStore<Flash<CAPACITY>>;

/// Stores of the board, which [`mount`] returns once.
pub struct Stores {
    /// Library store.
    pub libraries: Libraries,
    /// Flash of the boot counter. Its content is lost when the emulator ends.
    pub boots: Flash<BOOTS>,
}

struct Psram<const N: usize>(UnsafeCell<[u8; N]>);

// SAFETY: `mount` hands out the only references, once.
unsafe impl<const N: usize> Sync for Psram<N> {}

/// Memory of the libraries. The start-up code neither clears nor initialises it, which is sound because any byte value is
/// valid.
#[unsafe(link_section = ".library")]
static LIBRARIES: Psram<CAPACITY> = Psram(UnsafeCell::new([0; CAPACITY]));
#[unsafe(link_section = ".library")]
static COUNT: Psram<BOOTS> = Psram(UnsafeCell::new([0; BOOTS]));
static TAKEN: AtomicBool = AtomicBool::new(false);

/// Mounts the stores. Returns `None` on a second call.
pub fn mount() -> Option<Stores> {
    if TAKEN.swap(true, Ordering::AcqRel) {
        return None;
    }
    // SAFETY: the flag lets one caller through.
    let (libraries, boots) = unsafe { (&mut *LIBRARIES.0.get(), &mut *COUNT.0.get()) };
    let libraries = FlashStore::mount(RamFlash::new(libraries), TRIAL_BOOTS).ok()?;
    Some(Stores { libraries, boots: RamFlash::new(boots) })
}
