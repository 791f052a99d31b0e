//! Behaviour of the store without failures, and with decaying flash.

use super::nor::NorSimulator;
use super::*;
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};

type Flash = NorSimulator<8, 256>;

fn reboot(store: FlashStore<Flash>) -> FlashStore<Flash> {
    FlashStore::mount(store.into_flash(), TRIAL_BOOTS).unwrap()
}

#[test]
fn a_new_library_plays_on_trial_and_stays_when_confirmed() {
    let (a, b) = (library(1, 90), library(2, 100));
    let store = FlashStore::mount(Flash::blank(10), TRIAL_BOOTS).unwrap();
    assert!(store.bytes().is_empty());
    let mut store = reboot(holding(store.into_flash(), &a));
    assert_eq!((store.bytes(), store.on_trial()), (&a[..], false));
    send(&mut store, &b).unwrap();
    // Until activation, the old library is used.
    assert_eq!(store.bytes(), a);
    store.activate().unwrap();
    assert_eq!((store.bytes(), store.on_trial()), (&b[..], true));
    let mut store = reboot(store);
    assert_eq!((store.bytes(), store.on_trial()), (&b[..], true));
    store.confirm().unwrap();
    for _ in 0..5 {
        store = reboot(store);
        assert_eq!((store.bytes(), store.on_trial()), (&b[..], false));
    }
    assert_eq!(store.into_flash().overwrites, 0);
}

#[test]
fn a_trial_that_is_not_confirmed_rolls_back_by_itself() {
    let (a, b) = (library(1, 90), library(2, 90));
    let mut store = holding(Flash::blank(10), &a);
    send(&mut store, &b).unwrap();
    store.activate().unwrap();
    for _ in 0..TRIAL_BOOTS {
        store = reboot(store);
        assert_eq!(store.bytes(), b);
    }
    for _ in 0..3 {
        store = reboot(store);
        assert_eq!((store.bytes(), store.on_trial()), (&a[..], false));
    }
    // After a refusal, the old library is used at once.
    send(&mut store, &b).unwrap();
    store.activate().unwrap();
    let mut store = reboot(store);
    assert!(store.roll_back());
    assert_eq!(store.bytes(), a);
    assert!(!store.roll_back());
    assert_eq!(reboot(store).bytes(), a);
}

#[test]
fn the_first_library_is_not_rolled_back_to_nothing() {
    let a = library(1, 90);
    let mut store = FlashStore::mount(Flash::blank(10), TRIAL_BOOTS).unwrap();
    send(&mut store, &a).unwrap();
    store.activate().unwrap();
    for _ in 0..3 * TRIAL_BOOTS {
        store = reboot(store);
        assert_eq!((store.bytes(), store.on_trial()), (&a[..], true));
    }
    store.confirm().unwrap();
    assert!(!reboot(store).on_trial());
}

/// Refusal of a second library leaves the first library active, although the robot has not played the first one yet.
#[test]
fn the_first_library_outlasts_the_next_transfer() {
    let (a, b) = (library(1, 90), library(2, 100));
    for resets in [0, 1] {
        let mut store = FlashStore::mount(Flash::blank(10), TRIAL_BOOTS).unwrap();
        send(&mut store, &a).unwrap();
        store.activate().unwrap();
        for _ in 0..resets {
            store = reboot(store);
        }
        send(&mut store, &b).unwrap();
        assert_eq!(store.bytes(), a);
        store.abandon();
        assert_eq!(store.bytes(), a);
        let mut store = reboot(store);
        assert_eq!(store.bytes(), a);
        // The next library is on trial, and the first one is kept for a roll-back.
        send(&mut store, &b).unwrap();
        store.activate().unwrap();
        assert_eq!((store.bytes(), store.on_trial()), (&b[..], true));
        assert!(store.roll_back());
        assert_eq!(store.bytes(), a);
        assert_eq!(store.into_flash().overwrites, 0);
    }
}

#[test]
fn a_transfer_goes_on_after_a_reset() {
    let (a, b) = (library(1, 90), library(2, 400));
    assert!(b.len() > 520);
    let mut store = holding(Flash::blank(12), &a);
    assert_eq!(store.begin(b.len(), file_digest(&b)), Ok(0));
    store.write(0, &b[..300]).unwrap();
    assert_eq!(store.write(301, &b[301..302]), Err(StoreError::OutOfRange));
    // Blocks that are stored already, completely or partly.
    store.write(0, &b[..300]).unwrap();
    store.write(290, &b[290..520]).unwrap();
    let mut store = reboot(store);
    assert_eq!(store.bytes(), a);
    assert_eq!(store.seal(), Err(StoreError::NotSealed));
    assert_eq!(store.begin(b.len(), file_digest(&b)), Ok(512));
    store.write(512, &b[512..]).unwrap();
    let mut store = reboot(store);
    assert_eq!(store.begin(b.len(), file_digest(&b)), Ok(b.len()));
    store.seal().unwrap();
    assert_eq!(store.received(), b);
    store.activate().unwrap();
    assert_eq!(store.bytes(), b);
    // Another library starts from its beginning.
    let c = library(3, 90);
    assert_eq!(store.begin(c.len(), file_digest(&c)), Ok(0));
    assert_eq!((store.bytes(), store.on_trial()), (&a[..], false));
    assert_eq!(store.into_flash().overwrites, 0);
}

#[test]
fn what_is_not_what_was_announced_starts_again() {
    let (a, b) = (library(1, 90), library(2, 90));
    let mut store = holding(Flash::blank(10), &a);
    store.begin(b.len(), file_digest(&b)).unwrap();
    let mut other = b.clone();
    other[9] ^= 1;
    store.write(0, &other).unwrap();
    assert_eq!(
        (store.seal(), store.activate()),
        (Err(StoreError::Damaged), Err(StoreError::NotSealed))
    );
    assert!(store.received().is_empty());
    store.abandon();
    assert_eq!(store.begin(b.len(), file_digest(&b)), Ok(0));
    assert_eq!(store.bytes(), a);
}

/// A call erases one or two units, whatever the size of the library: the control loop waits for it.
#[test]
fn a_call_erases_little() {
    let b = library(2, 1200);
    let mut store = holding(Flash::blank(20), &library(1, 90));
    let erases = |store: &FlashStore<Flash>, so_far: &mut usize| {
        let now = store.flash.erases;
        now - core::mem::replace(so_far, now)
    };
    let mut so_far = store.flash.erases;
    store.begin(b.len(), file_digest(&b)).unwrap();
    assert!(erases(&store, &mut so_far) <= 2);
    for (i, block) in b.chunks(256).enumerate() {
        store.write(256 * i, block).unwrap();
        // The unit itself, and a unit of the log when the log changes units.
        assert!(erases(&store, &mut so_far) <= 2);
    }
    store.seal().unwrap();
    store.activate().unwrap();
    store.confirm().unwrap();
    assert!(erases(&store, &mut so_far) <= 1);
}

#[test]
fn footers_stand_in_for_a_lost_log() {
    let (a, b) = (library(1, 90), library(2, 100));
    let lose_log = |store: FlashStore<Flash>| {
        let mut flash = store.into_flash();
        flash.cells()[..512].fill(0);
        FlashStore::mount(flash, TRIAL_BOOTS).unwrap()
    };
    let mut store = lose_log(holding(Flash::blank(10), &a));
    assert_eq!(store.bytes(), a);
    send(&mut store, &b).unwrap();
    store.activate().unwrap();
    // Only on trial, so the confirmed library counts.
    let mut store = lose_log(store);
    assert_eq!(store.bytes(), a);
    send(&mut store, &b).unwrap();
    store.activate().unwrap();
    store.confirm().unwrap();
    let mut store = lose_log(store);
    assert_eq!(store.bytes(), b);
    send(&mut store, &a).unwrap();
    store.activate().unwrap();
    store.confirm().unwrap();
    assert_eq!(lose_log(store).bytes(), a);
}

#[test]
fn a_rotten_library_gives_way_to_the_other_one() {
    let (a, b) = (library(1, 90), library(2, 100));
    let mut store = holding(Flash::blank(10), &a);
    send(&mut store, &b).unwrap();
    store.activate().unwrap();
    let slot_b = 512 + slots::slot_len(&store.flash);

    // The library is on trial.
    let rot = |store: &FlashStore<Flash>, at: usize, unreadable: bool| {
        let mut flash = store.flash.clone();
        if unreadable {
            flash.make_unreadable(at)
        } else {
            flash.cells()[at] ^= 4
        }
        FlashStore::mount(flash, TRIAL_BOOTS).unwrap()
    };
    for unreadable in [false, true] {
        assert_eq!(rot(&store, slot_b + 40, unreadable).bytes(), a);
        assert_eq!(rot(&store, 512 + 40, unreadable).bytes(), b);
    }
    // The library is confirmed.
    store.confirm().unwrap();
    for unreadable in [false, true] {
        let mut rotten = rot(&store, slot_b + 40, unreadable);
        assert_eq!(rotten.bytes(), a);
        send(&mut rotten, &b).unwrap();
        rotten.activate().unwrap();
        assert_eq!(reboot(rotten).bytes(), b);
    }
}

#[test]
fn unusable_flash_is_refused() {
    assert_eq!(
        FlashStore::mount(NorSimulator::<8, 256>::blank(3), 3).err(),
        Some(GeometryError::Capacity)
    );
    assert_eq!(
        FlashStore::mount(NorSimulator::<64, 256>::blank(8), 3).err(),
        Some(GeometryError::WordSize)
    );
    assert_eq!(
        FlashStore::mount(NorSimulator::<8, 80>::blank(8), 3).err(),
        Some(GeometryError::EraseSize)
    );
    let mut store = FlashStore::mount(Flash::blank(4), 3).unwrap();
    assert_eq!(store.capacity(), 256 - 64);
    assert_eq!(store.begin(store.capacity() + 1, 0), Err(StoreError::OutOfRange));
    let full: Vec<u8> = (0..192).map(|i| i as u8).collect();
    let store = holding(Flash::blank(4), &full);
    assert_eq!(reboot(store).bytes(), full);
}

/// Flash with other read and write sizes.
struct ResizedFlash<const READ: usize, const WRITE: usize>(RamFlash<[u8; 8 * 4096]>);

impl<const READ: usize, const WRITE: usize> ErrorType for ResizedFlash<READ, WRITE> {
    type Error = NorFlashErrorKind;
}

impl<const READ: usize, const WRITE: usize> ReadNorFlash for ResizedFlash<READ, WRITE> {
    const READ_SIZE: usize = READ;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        self.0.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl<const READ: usize, const WRITE: usize> NorFlash for ResizedFlash<READ, WRITE> {
    const WRITE_SIZE: usize = WRITE;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        self.0.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        self.0.write(offset, bytes)
    }
}

impl<const READ: usize, const WRITE: usize> MappedFlash for ResizedFlash<READ, WRITE> {
    fn mapped(&self) -> &[u8] {
        self.0.mapped()
    }
}

/// Errors of library store and parameter store on a flash with the given word sizes.
fn refused<const READ: usize, const WRITE: usize>() -> [Option<GeometryError>; 2] {
    let blank = || ResizedFlash::<READ, WRITE>(RamFlash::new([0xFF; _]));
    [FlashStore::mount(blank(), 3).err(), FlashParameters::<_, 320>::mount(blank()).err()]
}

#[test]
fn each_word_size_is_looked_at() {
    let word_size = [Some(GeometryError::WordSize); 2];
    assert_eq!(refused::<1, 8>(), [None; 2]);
    assert_eq!(refused::<24, 8>(), word_size);
    assert_eq!(refused::<1, 24>(), word_size);
    assert_eq!(refused::<0, 8>(), word_size);
    assert_eq!(refused::<1, 0>(), word_size);
}

/// Footers that remain would refer to a slot whose library is being overwritten.
#[test]
fn a_transfer_does_not_begin_over_footers_that_cannot_be_erased() {
    let (a, b, c) = (library(1, 90), library(2, 100), library(3, 90));
    let mut store = holding(Flash::blank(10), &a);
    send(&mut store, &b).unwrap();
    store.activate().unwrap();
    store.confirm().unwrap();
    // C replaces A in slot A, units 2 to 5.
    store.flash.worn = Some(5);
    assert_eq!(store.begin(c.len(), file_digest(&c)), Err(StoreError::Medium));
    assert_eq!(store.write(0, &c), Err(StoreError::OutOfRange));
    assert_eq!(store.bytes(), b);
    store.flash.worn = None;
    send(&mut store, &c).unwrap();
    store.activate().unwrap();
    assert_eq!(reboot(store).bytes(), c);
}

/// Occasional writes fail without a power cut: a new transfer continues after each failure.
#[test]
fn a_flash_with_bad_days_still_gets_there() {
    let (a, b) = (library(1, 90), library(2, 400));
    let mut store = holding(Flash::blank(12), &a);
    store.flash.failing = Some(16);
    let mut failures = 0;
    while send(&mut store, &b).and_then(|()| store.activate()).is_err() {
        assert_eq!(store.bytes(), a);
        failures += 1;
        assert!(failures < 1000);
    }
    assert!(failures > 0);
    assert_eq!(store.bytes(), b);
}
