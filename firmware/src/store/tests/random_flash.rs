//! Arbitrary content of the flash: the store never panics and never returns a damaged library.

use super::nor::NorSimulator;
use super::*;
use crate::store::record::Record;
use proptest::prelude::*;

type Flash = NorSimulator<4, 256>;
const UNITS: usize = 8;

/// Mounts the flash, validates its library, and transfers, activates and confirms another one.
fn survive(cells: Vec<u8>, unreadable: &[u16]) {
    let mut flash = Flash::with(cells);
    for &at in unreadable {
        flash.make_unreadable(usize::from(at) % (UNITS * 256));
    }
    let mut store = FlashStore::mount(flash, TRIAL_BOOTS).unwrap();
    let image = store.active;
    assert_eq!(image.is_some(), !store.bytes().is_empty() || image.is_some_and(|i| i.len == 0));
    if let Some(image) = image {
        assert_eq!(file_digest(store.bytes()), image.digest);
    }
    let _ = validate(store.bytes(), &config());
    let new = library(9, 60);
    send(&mut store, &new).unwrap();
    store.activate().unwrap();
    let mut store = FlashStore::mount(store.into_flash(), TRIAL_BOOTS).unwrap();
    assert_eq!(store.bytes(), new);
    store.confirm().unwrap();
    assert_eq!(FlashStore::mount(store.into_flash(), TRIAL_BOOTS).unwrap().bytes(), new);
}

/// Record, footer or noise of 32 bytes, so that the later checks of mounting are reached too.
fn piece() -> impl Strategy<Value = [u8; 32]> {
    use crate::store::record::{Candidate, Footer, Image, Slot, StoreState};
    let number = || prop_oneof![0..700u32, any::<u32>()];
    let image = (any::<bool>(), number(), any::<u32>()).prop_map(|(b, len, digest)| Image {
        slot: if b { Slot::B } else { Slot::A },
        len,
        digest,
    });
    let candidate = prop_oneof![
        Just(Candidate::None),
        (number(), any::<u32>(), 0..700u32).prop_map(|(len, digest, have)| {
            Candidate::Receiving { len, digest, have: have.min(len) }
        }),
        (number(), any::<u32>(), any::<u8>())
            .prop_map(|(len, digest, boots_left)| { Candidate::Trial { len, digest, boots_left } }),
    ];
    prop_oneof![
        any::<[u8; 32]>(),
        Just([0xFF; 32]),
        (number(), proptest::option::of(image), candidate).prop_map(
            |(generation, confirmed, c)| {
                StoreState { confirmed, candidate: c }.encode(generation)
            }
        ),
        (number(), number(), any::<u32>()).prop_map(|(generation, len, digest)| Footer {
            generation,
            len,
            digest
        }
        .encode()),
    ]
}

proptest! {
    #[test]
    fn random_bytes(cells in proptest::collection::vec(any::<u8>(), UNITS * 256),
                    unreadable in proptest::collection::vec(any::<u16>(), 0..5)) {
        survive(cells, &unreadable);
    }

    #[test]
    fn random_records(pieces in proptest::collection::vec(piece(), UNITS * 8),
                      unreadable in proptest::collection::vec(any::<u16>(), 0..5)) {
        survive(pieces.concat(), &unreadable);
    }

    /// A valid store with arbitrary bytes overwritten returns one of its two libraries undamaged, or no library.
    #[test]
    fn damaged_store(damage in proptest::collection::vec((0..UNITS * 256, any::<u8>()), 1..40),
                     unreadable in proptest::collection::vec(any::<u16>(), 0..3)) {
        let (a, b) = (library(1, 60), library(2, 60));
        let mut store = holding(Flash::blank(UNITS), &a);
        send(&mut store, &b).unwrap();
        store.activate().unwrap();
        let mut flash = store.into_flash();
        for (at, byte) in damage {
            flash.cells()[at] = byte;
        }
        for at in unreadable {
            flash.make_unreadable(usize::from(at) % (UNITS * 256));
        }
        let store = FlashStore::mount(flash, TRIAL_BOOTS).unwrap();
        prop_assert!(store.bytes().is_empty() || store.bytes() == a || store.bytes() == b);
    }
}
