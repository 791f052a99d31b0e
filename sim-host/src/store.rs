//! Library store and parameter store of the simulated controller: the code of a real board, on flash that is simulated in RAM.

pub use rollwalk_firmware::store::VerifyingKey;
use rollwalk_firmware::store::{
    BootCounter, FlashParameters, FlashStore, LibraryStore, ParameterSet, ParameterStore, RamFlash,
    Signed, StoreError,
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

/// Function that saves a set of parameters outside the simulation, and returns false if this failed.
pub type KeepParameters = Box<dyn FnMut(&ParameterSet) -> bool + Send>;

/// Parameter store of the simulated controller: its flash, and a copy outside the simulation if [`Self::keep`] was called.
pub struct SimParameters {
    flash: FlashParameters<RamFlash<Vec<u8>>>,
    keep: Option<KeepParameters>,
}

impl SimParameters {
    /// Mounts the flash, as after a power cycle.
    fn mount(flash: RamFlash<Vec<u8>>, keep: Option<KeepParameters>) -> Self {
        Self { flash: FlashParameters::mount(flash).expect("three erase units"), keep }
    }

    /// Saves each set from now on before the controller answers its host. `saved` is the set of an earlier process.
    pub fn keep(&mut self, saved: Option<&ParameterSet>, keep: KeepParameters) {
        if let Some(set) = saved {
            self.flash.save(set).expect("a memory without faults");
        }
        self.keep = Some(keep);
    }
}

impl ParameterStore for SimParameters {
    fn load(&mut self) -> Option<ParameterSet> {
        self.flash.load()
    }

    fn save(&mut self, set: &ParameterSet) -> Result<(), StoreError> {
        let is_kept = self.keep.as_mut().is_none_or(|keep| keep(set));
        if is_kept { self.flash.save(set) } else { Err(StoreError::Medium) }
    }
}

/// Counter of the simulated controller's boots.
pub type SimBoots = BootCounter<RamFlash<Vec<u8>>>;

/// Boot counter before the first boot.
pub fn no_boots() -> SimBoots {
    BootCounter::mount(RamFlash::new(vec![0xFF; 12 << 10])).expect("three erase units")
}

/// Blank parameter store.
pub fn blank_parameters() -> SimParameters {
    SimParameters::mount(RamFlash::new(vec![0xFF; 12 << 10]), None)
}

/// Mounts both stores after a power cycle. With a key, the library store accepts only libraries signed with it.
pub fn mounted_again(
    (library, parameters): (SimStore, SimParameters),
    key: Option<VerifyingKey>,
) -> (SimStore, SimParameters) {
    let library = FlashStore::mount(library.into_inner().into_flash(), TRIAL_BOOTS);
    let SimParameters { flash, keep } = parameters;
    let library = library.expect("it was mounted before");
    let library = match key {
        Some(key) => Signed::new(library, key),
        None => Signed::unchecked(library),
    };
    (library, SimParameters::mount(flash.into_flash(), keep))
}

/// Library store with an active library that is not on trial.
pub fn with(library: &[u8]) -> SimStore {
    let mut store = blank();
    let crc = file_digest(library);
    store.begin(library.len(), crc).expect("the library fits");
    // In blocks, as on the link.
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
