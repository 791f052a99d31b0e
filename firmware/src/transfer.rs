//! Library transfer: receives blocks, checks the library and activates it.
//!
//! This module is the only writer of the store. Before a library changes, its index is dropped. Validation of the bytes that are
//! read back from the store creates a new index.
//!
//! A store with two slots keeps the active library playable during a transfer, and activates the new one on trial. The new
//! library is confirmed once one of its motions has been played and SAFE is reached again.

use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::{ClipId, Index, Library, Reject, RejectReason, validate};
use rollwalk_protocol::wire::transport::{Reply, Request, TransferResult};

use crate::store::{LibraryStore, StoreError};
use rollwalk_protocol::faults::Event;
use rollwalk_protocol::wire::State;

/// Transfer: announced length and digest, and offset of the next byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Transfer {
    len: u32,
    digest: u32,
    next: u32,
}

/// Progress of the active library's trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Proof {
    None,
    Asked,
    Playing,
    Played,
}

/// Store, its active library, and the transfer in progress.
pub(crate) struct LibraryStorage<S> {
    store: S,
    active: Option<Index>,
    transfer: Option<Transfer>,
    /// Index of a checked library that is not active yet.
    finished: Option<Index>,
    reject: Option<Reject>,
    proof: Proof,
    /// True if the active library could not be played. The next self test validates it again.
    suspect: bool,
}

impl<S: LibraryStore> LibraryStorage<S> {
    pub fn new(store: S) -> Self {
        let proof = Proof::None;
        Self {
            store,
            active: None,
            transfer: None,
            finished: None,
            reject: None,
            proof,
            suspect: false,
        }
    }

    /// Returns a reference to the store.
    pub fn store(&self) -> &S {
        &self.store
    }

    /// Returns the store.
    pub fn into_store(self) -> S {
        self.store
    }

    /// Active library.
    pub fn library(&self) -> Option<Library<'_>> {
        Library::open(self.store.bytes(), self.active.as_ref()?)
    }

    /// Reason why the store's content was refused.
    pub fn reject(&self) -> Option<Reject> {
        self.reject
    }

    /// True if the library was refused because it is for another robot.
    pub fn is_for_another_robot(&self) -> bool {
        matches!(self.reject, Some(Reject { why: RejectReason::WrongRobot { .. }, .. }))
    }

    /// Activates the store's library after power-on if it is valid. Rolls back an invalid library on trial.
    pub fn load(&mut self, config: &RobotConfig) {
        if core::mem::take(&mut self.suspect) {
            self.active = None;
        }
        while self.active.is_none() && !self.store.bytes().is_empty() {
            let checked = validate(self.store.bytes(), config);
            self.reject = checked.err();
            self.active = checked.ok();
            if self.active.is_none() && !self.store.roll_back() {
                break;
            }
        }
    }

    /// Records an event during playback.
    pub fn observe(&mut self, event: Event) {
        self.suspect |= event == Event::PlaybackFailed;
        self.proof = match (event, self.proof) {
            (Event::MotionStarted, Proof::None) => Proof::Asked,
            // The player was sent back to SAFE before it had left SAFE.
            (Event::SafeReached, Proof::Asked) => Proof::None,
            (Event::SafeReached, Proof::Playing) => Proof::Played,
            (event, _) if event.fault().is_some() => Proof::None,
            (_, proof) => proof,
        };
    }

    /// Records the clip that plays.
    pub fn on_clip(&mut self, clip: ClipId) {
        let left_safe = |library: Library<'_>| library.safe_node().clip() != clip;
        if self.proof == Proof::Asked && self.library().is_some_and(left_safe) {
            self.proof = Proof::Playing;
        }
    }

    /// Confirms a library on trial that has completed a motion, as soon as the store may be written. Call it once per control
    /// period.
    pub fn settle(&mut self, state: State) {
        if state == State::Disarmed && self.proof == Proof::Played {
            // If the store fails, the library stays on trial; the next motion tries again.
            let _ = self.confirm();
        }
    }

    /// Confirms the active library.
    pub fn confirm(&mut self) -> Result<(), StoreError> {
        self.proof = Proof::None;
        if self.store.on_trial() {
            self.store.confirm()?;
            self.transfer = None;
            self.finished = None;
        }
        Ok(())
    }

    /// True if the active library is on trial.
    pub fn on_trial(&self) -> bool {
        self.store.on_trial()
    }

    /// Offset of the first missing byte of the transfer.
    pub fn next(&self) -> u32 {
        self.transfer.map_or(0, |transfer| transfer.next)
    }

    /// Carries out a transfer request. `may_write` is true while torque is off and arming has not begun.
    pub fn handle(
        &mut self,
        request: &Request<'_>,
        may_write: bool,
        config: &RobotConfig,
    ) -> Reply {
        let result = if may_write {
            match *request {
                Request::Hello { .. } | Request::Log { .. } => TransferResult::UnknownRequest,
                Request::Begin { len, digest } => self.begin(len, digest, config),
                Request::Block { offset, bytes } => self.block(offset, bytes),
                Request::Finish => match self.finish(config) {
                    Ok(result) => result,
                    Err(reject) => return Reply::rejected(request.kind(), &reject),
                },
                Request::Activate { digest } => self.activate(digest),
            }
        } else {
            TransferResult::WrongState
        };
        Reply::new(request.kind(), result, self.next())
    }

    fn begin(&mut self, len: u32, digest: u32, config: &RobotConfig) -> TransferResult {
        if self.transfer.is_some_and(|t| (t.len, t.digest) == (len, digest)) {
            // The same request resumes the transfer.
            return TransferResult::Ok;
        }
        let size = usize::try_from(len).unwrap_or(usize::MAX);
        if size > self.store.capacity() {
            return TransferResult::TooLong;
        }
        self.transfer = None;
        self.finished = None;
        self.active = None;
        self.reject = None;
        self.proof = Proof::None;
        let begun = self.store.begin(size, digest);
        if self.store.keeps_library() {
            // The active library stays, but a library on trial gives way to the confirmed one.
            self.load(config);
        }
        match begun {
            Ok(next) => {
                let next = u32::try_from(next).unwrap_or(0).min(len);
                self.transfer = Some(Transfer { len, digest, next });
                TransferResult::Ok
            }
            Err(error) => result(error),
        }
    }

    fn block(&mut self, offset: u32, bytes: &[u8]) -> TransferResult {
        let Some(transfer) = self.transfer else { return TransferResult::NotBegun };
        let len = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
        let Some(end) = offset.checked_add(len).filter(|&end| end <= transfer.len) else {
            return TransferResult::TooLong;
        };
        if offset > transfer.next {
            return TransferResult::OutOfOrder;
        }
        if end <= transfer.next {
            return TransferResult::Ok;
        }
        self.finished = None;
        self.leave_library();
        let Ok(at) = usize::try_from(offset) else { return TransferResult::TooLong };
        match self.store.write(at, bytes) {
            Ok(()) => {
                self.transfer = Some(Transfer { next: end, ..transfer });
                TransferResult::Ok
            }
            Err(error) => {
                // Another Begin can resume from the bytes written before.
                self.transfer = None;
                result(error)
            }
        }
    }

    fn finish(&mut self, config: &RobotConfig) -> Result<TransferResult, Reject> {
        let Some(transfer) = self.transfer else { return Ok(TransferResult::NotBegun) };
        if transfer.next < transfer.len {
            return Ok(TransferResult::Incomplete);
        }
        // Validated as read back from the store, not as received over the bus.
        if let Err(error) = self.store.seal() {
            self.forget();
            return Ok(result(error));
        }
        match validate(self.store.received(), config) {
            Ok(index) => {
                self.finished = Some(index);
                Ok(TransferResult::Ok)
            }
            Err(reject) => {
                self.forget();
                self.reject = self.active.is_none().then_some(reject);
                Err(reject)
            }
        }
    }

    fn activate(&mut self, digest: u32) -> TransferResult {
        let (Some(transfer), Some(index)) = (self.transfer, self.finished) else {
            return TransferResult::NotFinished;
        };
        if transfer.digest != digest {
            return TransferResult::NotFinished;
        }
        match self.store.activate() {
            Ok(()) => {
                self.active = Some(index);
                self.reject = None;
                TransferResult::Ok
            }
            Err(error) => result(error),
        }
    }

    /// Drops the incoming library after a failed check.
    fn forget(&mut self) {
        self.finished = None;
        self.transfer = None;
        self.leave_library();
        self.store.abandon();
    }

    /// Invalidates the active library, because the store's only slot changes.
    fn leave_library(&mut self) {
        if !self.store.keeps_library() {
            self.active = None;
        }
    }
}

fn result(error: StoreError) -> TransferResult {
    match error {
        StoreError::OutOfRange => TransferResult::TooLong,
        StoreError::Medium => TransferResult::StoreFailed,
        StoreError::Damaged => TransferResult::BadCrc,
        StoreError::Unsigned => TransferResult::Rejected,
        StoreError::NotSealed => TransferResult::NotFinished,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::tests::config;
    use crate::store::{FlashStore, RamStore};
    use TransferResult as R;
    use rollwalk_protocol::crc::file_digest;
    use rollwalk_protocol::library::{LibrarySpec, MotionSpec, encode};

    fn library(config: &RobotConfig) -> heapless::Vec<u8, 1024> {
        let motions = [MotionSpec {
            name: "stand",
            code: 1,
            looping: true,
            frames: &[0.5, 0.5],
            torques: &[],
        }];
        let spec = LibrarySpec { config, motions: &motions, transitions: &[], safe: 0 };
        let mut bytes = [0; 1024];
        let len = encode(&spec, &mut bytes).unwrap();
        bytes[..len].iter().copied().collect()
    }

    fn send(storage: &mut LibraryStorage<RamStore<1024>>, request: Request<'_>) -> (R, u32) {
        let reply = storage.handle(&request, true, &config());
        assert_eq!(reply.request, request.kind());
        (reply.result, reply.next)
    }

    fn begin(bytes: &[u8]) -> Request<'static> {
        Request::Begin { len: bytes.len() as u32, digest: file_digest(bytes) }
    }

    #[test]
    fn arrives_in_blocks_and_is_used_only_after_activation() {
        let bytes = library(&config());
        let digest = file_digest(&bytes);
        let mut storage = LibraryStorage::new(RamStore::<1024>::new());
        assert_eq!(send(&mut storage, Request::Finish), (R::NotBegun, 0));
        assert_eq!(
            send(&mut storage, Request::Block { offset: 0, bytes: &bytes[..9] }),
            (R::NotBegun, 0)
        );
        assert_eq!(send(&mut storage, begin(&bytes)), (R::Ok, 0));
        let n = bytes.len() as u32;
        assert_eq!(
            send(&mut storage, Request::Block { offset: 0, bytes: &bytes[..100] }),
            (R::Ok, 100)
        );
        // A repeated block, a block too far ahead, and an incomplete library.
        assert_eq!(
            send(&mut storage, Request::Block { offset: 0, bytes: &bytes[..100] }),
            (R::Ok, 100)
        );
        assert_eq!(
            send(&mut storage, Request::Block { offset: 120, bytes: &bytes[120..] }),
            (R::OutOfOrder, 100)
        );
        assert_eq!(send(&mut storage, Request::Finish), (R::Incomplete, 100));
        // After a loss of the link the same Begin resumes.
        assert_eq!(send(&mut storage, begin(&bytes)), (R::Ok, 100));
        assert_eq!(
            send(&mut storage, Request::Block { offset: 50, bytes: &bytes[50..] }),
            (R::Ok, n)
        );
        assert_eq!(send(&mut storage, Request::Activate { digest }), (R::NotFinished, n));
        assert_eq!(send(&mut storage, Request::Finish), (R::Ok, n));
        assert!(storage.library().is_none());
        assert_eq!(send(&mut storage, Request::Activate { digest: !digest }), (R::NotFinished, n));
        assert_eq!(send(&mut storage, Request::Activate { digest }), (R::Ok, n));
        assert!(storage.library().is_some());

        // For another library the store changes, and the active one is dropped.
        assert_eq!(send(&mut storage, Request::Begin { len: 4000, digest: 1 }).0, R::TooLong);
        assert!(storage.library().is_some());
        assert_eq!(send(&mut storage, Request::Begin { len: 400, digest: 1 }), (R::Ok, 0));
        assert!(storage.library().is_none());
    }

    #[test]
    fn what_arrives_damaged_or_for_another_robot_is_refused() {
        let mut other = config();
        other.channels[0].max_torque_nm = 2.0;
        let bytes = library(&other);
        let mut storage = LibraryStorage::new(RamStore::<1024>::new());
        send(&mut storage, begin(&bytes));
        send(&mut storage, Request::Block { offset: 0, bytes: &bytes });
        assert_eq!(send(&mut storage, Request::Finish).0, R::Rejected);
        assert!(storage.is_for_another_robot());

        let bytes = library(&config());
        send(&mut storage, Request::Begin { len: bytes.len() as u32, digest: 7 });
        send(&mut storage, Request::Block { offset: 0, bytes: &bytes });
        assert_eq!(send(&mut storage, Request::Finish).0, R::BadCrc);
        // The transfer begins from the start, not from the end of the damaged transfer.
        assert_eq!(send(&mut storage, begin(&bytes)), (R::Ok, 0));
        assert!(storage.library().is_none());
    }

    #[test]
    fn nothing_is_written_while_that_is_not_allowed() {
        let bytes = library(&config());
        let mut storage = LibraryStorage::new(RamStore::<1024>::new());
        for request in [
            begin(&bytes),
            Request::Block { offset: 0, bytes: &bytes },
            Request::Finish,
            Request::Activate { digest: 0 },
        ] {
            assert_eq!(storage.handle(&request, false, &config()).result, R::WrongState);
        }
        assert_eq!(send(&mut storage, Request::Finish).0, R::NotBegun);
    }

    #[test]
    fn a_store_that_holds_a_library_is_used_after_power_on() {
        let bytes = library(&config());
        let mut storage = LibraryStorage::new(RamStore::<1024>::holding(&bytes).unwrap());
        storage.load(&config());
        assert!(storage.library().is_some());

        let mut damaged = bytes.clone();
        damaged[40] ^= 1;
        let mut storage = LibraryStorage::new(RamStore::<1024>::holding(&damaged).unwrap());
        storage.load(&config());
        assert!(storage.library().is_none() && storage.reject().is_some());
    }

    type Flash = crate::store::tests::nor::NorSimulator<8, 64>;

    fn reset(storage: LibraryStorage<FlashStore<Flash>>) -> LibraryStorage<FlashStore<Flash>> {
        let store = FlashStore::mount(storage.store.into_flash(), 2).unwrap();
        let mut storage = LibraryStorage::new(store);
        storage.load(&config());
        storage
    }

    fn ask(storage: &mut LibraryStorage<FlashStore<Flash>>, request: Request<'_>) -> (R, u32) {
        let reply = storage.handle(&request, true, &config());
        (reply.result, reply.next)
    }

    /// The next self test validates a library again only if it could not be played. It need not read the whole library after
    /// every other fault.
    #[test]
    fn what_could_not_be_played_is_validated_again() {
        let first = library(&config());
        let mut storage = LibraryStorage::new(RamStore::<1024>::holding(&first).unwrap());
        storage.load(&config());
        let mut rotten = first.clone();
        rotten[40] ^= 1;
        storage.store = RamStore::holding(&rotten).unwrap();
        storage.observe(Event::HostLost);
        storage.load(&config());
        assert!(storage.active.is_some());
        storage.observe(Event::PlaybackFailed);
        storage.load(&config());
        assert!(storage.active.is_none() && storage.reject().is_some());
    }

    /// A motion that ended in a fault proves nothing about its library, whatever the fault was.
    #[test]
    fn every_fault_voids_what_a_trial_has_shown() {
        let bytes = library(&config());
        let digest = file_digest(&bytes);
        let mut storage = LibraryStorage::new(FlashStore::mount(Flash::blank(12), 2).unwrap());
        let request = Request::Block { offset: 0, bytes: &bytes };
        for request in [begin(&bytes), request, Request::Finish, Request::Activate { digest }] {
            assert_eq!(ask(&mut storage, request).0, R::Ok);
        }
        let play = |storage: &mut LibraryStorage<_>, then: &[Event]| {
            storage.observe(Event::MotionStarted);
            storage.on_clip(ClipId(1));
            storage.observe(Event::SafeReached);
            then.iter().for_each(|&event| storage.observe(event));
            storage.settle(State::Disarmed);
            storage.on_trial()
        };
        for &event in Event::ALL.iter().filter(|event| event.fault().is_some()) {
            assert!(play(&mut storage, &[event]), "{event:?}");
        }
        assert!(!play(&mut storage, &[Event::Disarm, Event::SafeReached, Event::HoldElapsed]));
    }

    #[test]
    fn resumes_after_a_reset_and_rolls_back_what_never_played() {
        let first = library(&config());
        let (len, digest) = (first.len() as u32, file_digest(&first));
        assert!(len > 100);
        let mut storage = LibraryStorage::new(FlashStore::mount(Flash::blank(12), 2).unwrap());
        assert_eq!(ask(&mut storage, begin(&first)), (R::Ok, 0));
        let some = Request::Block { offset: 0, bytes: &first[..70] };
        assert_eq!(ask(&mut storage, some), (R::Ok, 70));
        let mut storage = reset(storage);
        assert!(storage.library().is_none());
        assert_eq!(ask(&mut storage, Request::Finish), (R::NotBegun, 0));
        assert_eq!(ask(&mut storage, begin(&first)), (R::Ok, 64));
        let rest = Request::Block { offset: 64, bytes: &first[64..] };
        assert_eq!(ask(&mut storage, rest), (R::Ok, len));
        assert_eq!(ask(&mut storage, Request::Finish), (R::Ok, len));
        assert_eq!(ask(&mut storage, Request::Activate { digest }), (R::Ok, len));
        assert_eq!(ask(&mut storage, Request::Activate { digest }), (R::Ok, len));
        // A return to SAFE before the motion has left it proves nothing.
        storage.observe(Event::MotionStarted);
        storage.on_clip(ClipId(0));
        storage.observe(Event::SafeReached);
        storage.settle(State::Disarmed);
        assert!(storage.on_trial());
        // One complete motion, but not the next: this proves nothing either.
        storage.observe(Event::MotionStarted);
        storage.on_clip(ClipId(1));
        storage.observe(Event::SafeReached);
        storage.observe(Event::Tipped);
        storage.settle(State::Disarmed);
        assert!(storage.on_trial());
        storage.observe(Event::MotionStarted);
        storage.on_clip(ClipId(1));
        storage.observe(Event::SafeReached);
        storage.settle(State::Ready);
        assert!(storage.on_trial());
        storage.settle(State::Disarmed);
        assert!(!storage.on_trial());

        // A library for another robot is refused. The first library stays active, now and after a reset.
        let mut other = config();
        other.channels[0].max_torque_nm = 2.0;
        let second = library(&other);
        assert_eq!(ask(&mut storage, begin(&second)), (R::Ok, 0));
        assert_eq!(ask(&mut storage, Request::Block { offset: 0, bytes: &second }).0, R::Ok);
        assert_eq!(ask(&mut storage, Request::Finish).0, R::Rejected);
        assert!(storage.library().is_some() && storage.reject().is_none());

        // The robot is exchanged during the trial: the library is refused at the next start and rolled back.
        let mut storage = reset(storage);
        assert_eq!(ask(&mut storage, begin(&second)), (R::Ok, 0));
        assert_eq!(ask(&mut storage, Request::Block { offset: 0, bytes: &second }).0, R::Ok);
        let finish = storage.handle(&Request::Finish, true, &other);
        assert_eq!(finish.result, R::Ok);
        assert_eq!(ask(&mut storage, Request::Activate { digest: file_digest(&second) }).0, R::Ok);
        assert!(storage.on_trial());
        let storage = reset(storage);
        assert!(!storage.on_trial() && storage.reject().is_none());
        assert_eq!(storage.library().unwrap().index().len_bytes(), len);
        assert_eq!(storage.store.bytes(), first);
    }
}
