//! Library store and parameter store of the simulated controller: the code of a real board, on flash that is simulated in RAM.

pub use rollwalk_firmware::store::VerifyingKey;
use rollwalk_firmware::store::{
    BootCounter, FlashParameters, FlashStore, LibraryStore, RamFlash, Signed,
};
use rollwalk_protocol::crc::file_digest;
use rollwalk_protocol::wire::transport::MAX_BLOCK;

/// Maximum size of a library, bytes.
pub const LIBRARY_MAX: usize = 1 << 20;
/// Size of the flash, bytes: two libraries and the log of the store.
const CAPACITY: usize = 2 * LIBRARY_MAX + (8 << 10);
/// Number of boots after which an unconfirmed library on trial is rolled back.
const TRIAL_BOOTS: u8 = 3;

/// Library store of the simulated controller.
pub type SimStore = Signed<FlashStore<RamFlash<Vec<u8>>>>;

/// Parameter store of the simulated controller.
pub type SimParameters = FlashParameters<RamFlash<Vec<u8>>>;

/// Counter of the simulated controller's boots.
pub type SimBoots = BootCounter<RamFlash<Vec<u8>>>;

/// Boot counter before the first boot.
pub fn no_boots() -> SimBoots {
    BootCounter::mount(RamFlash::new(vec![0xFF; 12 << 10])).expect("three erase units")
}

/// Blank parameter store.
pub fn blank_parameters() -> SimParameters {
    FlashParameters::mount(RamFlash::new(vec![0xFF; 12 << 10])).expect("three erase units")
}

/// Mounts both stores after a power cycle. With a key, the library store accepts only libraries signed with it.
pub fn mounted_again(
    (library, parameters): (SimStore, SimParameters),
    key: Option<VerifyingKey>,
) -> (SimStore, SimParameters) {
    let library = FlashStore::mount(library.into_inner().into_flash(), TRIAL_BOOTS);
    let parameters = FlashParameters::mount(parameters.into_flash());
    let library = library.expect("it was mounted before");
    let library = match key {
        Some(key) => Signed::new(library, key),
        None => Signed::unchecked(library),
    };
    (library, parameters.expect("it was mounted before"))
}

/// Library store with an active library that is not on trial.
pub fn with(library: &[u8]) -> SimStore {
    let mut store = blank();
    let crc = file_digest(library);
    store.begin(library.len(), crc).expect("the library fits");
    // In blocks, as over the link.
    for (number, block) in library.chunks(MAX_BLOCK).enumerate() {
        store.write(number * MAX_BLOCK, block).expect("a memory without faults");
    }
    store.seal().expect("what was written is there");
    store.activate().expect("it was sealed");
    store.confirm().expect("it was activated");
    store
}

/// Blank library store that accepts libraries without a signature.
pub fn blank() -> SimStore {
    let flash = FlashStore::mount(RamFlash::new(vec![0xFF; CAPACITY]), TRIAL_BOOTS);
    Signed::unchecked(flash.expect("the capacity is made of whole erase units"))
}
