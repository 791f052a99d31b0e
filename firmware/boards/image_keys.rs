//! Keys of a board's image. `cargo xtask image` fills them into a program with the features `authenticated` and `signed`
//! (`firmware/src/hal/key_block.rs`).
//!
//! A program with one of these features does not start without its key: a lost key must not turn into no protection.

use rollwalk_firmware::Controller;
#[cfg(any(feature = "authenticated", feature = "signed"))]
use rollwalk_firmware::hal::key_block::{self, Keys};
use rollwalk_firmware::store::{FlashStore, LibraryStore, MappedFlash, ParameterStore};

/// The board's store of libraries.
#[cfg(not(feature = "signed"))]
pub type Libraries<F> = FlashStore<F>;
/// The board's store of libraries, which must be signed.
#[cfg(feature = "signed")]
pub type Libraries<F> = rollwalk_firmware::store::Signed<FlashStore<F>>;

/// The block of keys. `cargo xtask image` finds it by its name.
#[cfg(any(feature = "authenticated", feature = "signed"))]
#[used]
#[unsafe(no_mangle)]
static ROLLWALK_KEYS: [u8; key_block::LEN] = key_block::BLANK;

/// The keys that were filled in; `None` if none were.
#[cfg(any(feature = "authenticated", feature = "signed"))]
fn keys() -> Option<Keys> {
    // SAFETY: it reads a static. Volatile, because the compiler knows the blank block only.
    Keys::decode(&unsafe { (&raw const ROLLWALK_KEYS).read_volatile() })
}

/// The store, which lets signed libraries pass only, if the image has a library key. `None`: that key is not there.
pub fn trusting<F: MappedFlash>(store: FlashStore<F>) -> Option<Libraries<F>> {
    #[cfg(feature = "signed")]
    let store = {
        let key = rollwalk_firmware::store::VerifyingKey::from_bytes(&keys()?.library?).ok()?;
        Libraries::new(store, key)
    };
    Some(store)
}

/// Lets the controller obey hosts with the link key only, if the image has one, and counts the boot in `boots`, which
/// belongs to the counter alone. `None`: the key is not there, or the flash is unfit for the counter.
pub fn insist<S: LibraryStore, P: ParameterStore, F: MappedFlash>(
    controller: &mut Controller<S, P>,
    boots: F,
) -> Option<()> {
    #[cfg(not(feature = "authenticated"))]
    let _ = (controller, boots);
    #[cfg(feature = "authenticated")]
    {
        let key = rollwalk_protocol::wire::authentication::LinkKey::new(&keys()?.link?);
        let mut boots = rollwalk_firmware::store::BootCounter::mount(boots).ok()?;
        // A boot that cannot be counted gives no session: the robot obeys emergency stops only.
        controller.insist_on(key, boots.count().ok());
    }
    Some(())
}
