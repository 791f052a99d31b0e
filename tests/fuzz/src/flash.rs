//! Flash of the bench. It is the one of the store's tests, with the words and units of an STM32G4, and without faults.

extern crate std;

use rollwalk_firmware::store::{FlashParameters, FlashStore, LibraryStore};
use rollwalk_protocol::crc::file_digest;

/// Simulated flash with all kinds of failures.
#[path = "../../../firmware/src/store/tests/nor.rs"]
#[allow(dead_code)]
pub mod nor;

/// Flash type of the bench.
pub type Flash = nor::NorSimulator<8, 2048>;

const TRIAL_BOOTS: u8 = 3;

/// Blank store, or a store with a confirmed library.
pub fn store(library: Option<&[u8]>) -> FlashStore<Flash> {
    let mut store = FlashStore::mount(Flash::blank(18), TRIAL_BOOTS).expect("sound geometry");
    if let Some(bytes) = library {
        store.begin(bytes.len(), file_digest(bytes)).expect("there is room");
        store.write(0, bytes).expect("flash that works");
        store.seal().expect("flash that works");
        store.activate().expect("flash that works");
        store.confirm().expect("flash that works");
    }
    store
}

/// Blank memory for parameters.
pub fn parameters() -> FlashParameters<Flash> {
    FlashParameters::mount(Flash::blank(3)).expect("sound geometry")
}

/// Mounts both stores again after a power cycle.
pub fn mounted_again(
    (library, parameters): (FlashStore<Flash>, FlashParameters<Flash>),
) -> (FlashStore<Flash>, FlashParameters<Flash>) {
    let library = FlashStore::mount(library.into_flash(), TRIAL_BOOTS).expect("sound geometry");
    let parameters = FlashParameters::mount(parameters.into_flash()).expect("sound geometry");
    (library, parameters)
}
