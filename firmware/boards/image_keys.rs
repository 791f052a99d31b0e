//! Keys of a board's image. `cargo xtask image` writes them into a program with the features `authenticated` and `signed`
//! (`firmware/src/hal/key_block.rs`).
//!
//! A program with one of these features does not start without its key, so that a missing key never disables the protection.

use rollwalk_firmware::Controller;
#[cfg(any(feature = "authenticated", feature = "signed"))]
use rollwalk_firmware::hal::key_block::{self, Keys};
use rollwalk_firmware::store::{FlashStore, LibraryStore, MappedFlash, ParameterStore};

/// Library store of the board.
#[cfg(not(feature = "signed"))]
pub type Libraries<F> = FlashStore<F>;
/// Library store of the board, which accepts only signed libraries.
#[cfg(feature = "signed")]
pub type Libraries<F> = rollwalk_firmware::store::Signed<FlashStore<F>>;

/// Block of keys, which `cargo xtask image` finds by its name.
#[cfg(any(feature = "authenticated", feature = "signed"))]
#[used]
#[unsafe(no_mangle)]
static ROLLWALK_KEYS: [u8; key_block::LEN] = key_block::BLANK;

/// Keys of the image; `None` if no keys were written into it.
#[cfg(any(feature = "authenticated", feature = "signed"))]
fn keys() -> Option<Keys> {
    // SAFETY: reads a static. The read is volatile, because the compiler knows only the blank block.
    Keys::decode(&unsafe { (&raw const ROLLWALK_KEYS).read_volatile() })
}

/// Wraps the store so that it accepts only signed libraries, in an image with the feature `signed`. Returns `None` if the image
/// lacks the library key.
pub fn require_signatures<F: MappedFlash>(store: FlashStore<F>) -> Option<Libraries<F>> {
    #[cfg(feature = "signed")]
    let store = {
        let key = rollwalk_firmware::store::VerifyingKey::from_bytes(&keys()?.library?).ok()?;
        Libraries::new(store, key)
    };
    Some(store)
}

/// Requires the link key from hosts, in an image with the feature `authenticated`, and counts the boot in `boots`.
///
/// All of `boots` belongs to the counter. Returns `None` if the image lacks the link key or the flash is unfit for the counter.
pub fn require_key<S: LibraryStore, P: ParameterStore, F: MappedFlash>(
    controller: &mut Controller<S, P>,
    boots: F,
) -> Option<()> {
    #[cfg(not(feature = "authenticated"))]
    let _ = (controller, boots);
    #[cfg(feature = "authenticated")]
    {
        let key = rollwalk_protocol::wire::authentication::LinkKey::new(&keys()?.link?);
        let mut boots = rollwalk_firmware::store::BootCounter::mount(boots).ok()?;
        // If a boot cannot be counted, no session is possible, and the robot obeys emergency stops only.
        controller.require_key(key, boots.count().ok());
    }
    Some(())
}
