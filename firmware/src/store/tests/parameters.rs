//! Tests of the parameter store: power fails at every byte of a save, and again during the recovery. Each time, either the
//! previous set or the new one must be there, undamaged.
//!
//! The test checks itself: every scheduled cut must happen, and it must find planted bugs.

use proptest::prelude::*;

use super::nor::{ALL_TORN, CutDamage, NorSimulator};
use super::std::string::String;
use super::std::{format, println};
use super::*;
use crate::store::log::Log;
use crate::store::parameters::{PARAMETERS, set_len};
use crate::store::record::Record;
use embedded_storage::nor_flash::NorFlash;
use rollwalk_protocol::crc::crc32c;

/// Length of a set of a robot with up to 24 channels, bytes.
const SET_LEN: usize = set_len(24);
/// Store of a robot with up to 24 channels.
type Store<F> = FlashParameters<F, SET_LEN>;

/// Interval of the second cuts, bytes. Their offset shifts with the first cut.
const SECOND_STEP: usize = 131;

/// Planted bug of a store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bug {
    None,
    /// Erases the unit with the newest set when the log moves to the next unit.
    EraseNewest,
    /// Uses two units in turn. That would suffice if a record that was readable once stayed readable.
    TwoUnits,
    /// Uses a single location, erased and written again.
    InPlace,
    /// Accepts a set with a wrong checksum.
    BelieveAnything,
}

/// Parameter set for 24 channels, with distinct values.
fn set(seed: u16) -> ParameterSet {
    set_of(24, seed)
}

fn set_of(channels: u16, seed: u16) -> ParameterSet {
    let value = |i: u16| f32::from(seed) + f32::from(i) / 128.0;
    let values = (0..channels).map(|c| [0, 1, 2].map(|p| value(3 * c + p))).collect();
    let feed_forward = if seed.is_multiple_of(2) { 1.0 } else { f32::from(seed) / 256.0 };
    ParameterSet { config_hash: 0x1234_5678 ^ u32::from(seed), values, feed_forward }
}

/// Parameter set that ignores its checksum.
struct UncheckedSet(ParameterSet);

impl Record<SET_LEN> for UncheckedSet {
    fn encode(&self, generation: u32) -> [u8; SET_LEN] {
        self.0.encode(generation)
    }

    fn decode(bytes: &[u8; SET_LEN]) -> Option<(u32, Self)> {
        let mut mended = *bytes;
        let (body, crc) = mended.split_last_chunk_mut::<4>()?;
        *crc = crc32c(body).to_le_bytes();
        ParameterSet::decode(&mended).map(|(generation, set)| (generation, Self(set)))
    }
}

#[derive(Default, Debug)]
struct CutCounts {
    cuts: usize,
    second_cuts: usize,
    /// Number of cuts after which the new set was stored although its save was not acknowledged.
    early: usize,
}

struct Bench<const W: usize, const E: usize> {
    before: Option<ParameterSet>,
    new: ParameterSet,
    torn: CutDamage,
    bug: Bug,
}

impl<const W: usize, const E: usize> Bench<W, E> {
    /// Saves the new set; returns the flash, and true if the save was acknowledged.
    fn save(&self, flash: NorSimulator<W, E>) -> (NorSimulator<W, E>, bool) {
        let mut store = Store::mount(flash).unwrap();
        if self.bug == Bug::EraseNewest {
            store.log.forget_the_newest();
        }
        if self.bug == Bug::TwoUnits {
            store.log.turn_two_units_only();
        }
        if self.bug == Bug::InPlace {
            let mut flash = store.into_flash();
            let all = flash.cells().len() as u32;
            let done = flash
                .erase(0, all)
                .and_then(|()| flash.write(0, &Record::<SET_LEN>::encode(&self.new, 9)));
            return (flash, done.is_ok());
        }
        let saved = store.save(&self.new).is_ok();
        (store.into_flash(), saved)
    }

    /// Checks that the set after a reset is the previous or the new one. Returns true if it is the new one.
    fn judge(&self, flash: &NorSimulator<W, E>, saved: bool) -> Result<bool, String> {
        let mut flash = flash.clone();
        let loaded = if self.bug == Bug::BelieveAnything {
            Log::mount::<SET_LEN, UncheckedSet, _>(&mut flash).unwrap().1.map(|set| set.0)
        } else {
            Store::mount(flash.clone()).unwrap().load()
        };
        let is_new = loaded.as_ref() == Some(&self.new);
        if !is_new && loaded != self.before {
            return Err(format!("what is there is neither: {loaded:?}"));
        }
        if saved && !is_new {
            return Err("it was saved and is not there".into());
        }
        if flash.overwrites > 0 {
            return Err(format!("{} words were written twice", flash.overwrites));
        }
        Ok(is_new)
    }

    fn run(&self, start: &NorSimulator<W, E>) -> Result<CutCounts, String> {
        let mut report = CutCounts::default();
        let used = |flash: &NorSimulator<W, E>| {
            let mut flash = flash.clone();
            flash.arm(self.torn, None);
            let (flash, saved) = self.save(flash);
            assert!(saved, "fails without a cut");
            flash.used
        };
        for fuel in 0..used(start) {
            let at = |why| format!("cut at {fuel}: {why}");
            let flash = self.cut(start, fuel);
            report.cuts +=
                flash.cut_writes + flash.cut_erases - start.cut_writes - start.cut_erases;
            report.early += usize::from(self.judge(&flash, false).map_err(at)?);
            for second in (fuel % SECOND_STEP..used(&flash)).step_by(SECOND_STEP) {
                let mut flash = self.cut(&flash, second);
                report.second_cuts += 1;
                self.judge(&flash, false).map_err(at)?;
                flash.fade();
                self.judge(&flash, false).map_err(at)?;
            }
            let mut faded = flash;
            faded.fade();
            self.judge(&faded, false).map_err(at)?;
            let (flash, saved) = self.save(faded);
            assert!(saved, "cannot be mended");
            self.judge(&flash, true).map_err(at)?;
        }
        Ok(report)
    }

    /// Saves until the power fails after `fuel` bytes, then restores power.
    fn cut(&self, start: &NorSimulator<W, E>, fuel: usize) -> NorSimulator<W, E> {
        let mut flash = start.clone();
        flash.arm(self.torn, Some(fuel));
        let (mut flash, saved) = self.save(flash);
        assert!(!flash.has_power() && !saved, "no cut at {fuel}");
        flash.power_on();
        flash
    }
}

/// Creates a flash in which `saves` sets were saved; returns it with the newest set.
fn start<const W: usize, const E: usize>(
    units: usize,
    saves: u16,
) -> (NorSimulator<W, E>, Option<ParameterSet>) {
    let mut store = Store::mount(NorSimulator::<W, E>::blank(units)).unwrap();
    (0..saves).for_each(|i| store.save(&set(i)).unwrap());
    let last = store.load();
    assert_eq!(last, saves.checked_sub(1).map(set));
    (store.into_flash(), last)
}

/// Cuts power during a save after 0 to `saves` earlier ones, so that each unit is erased once.
fn torture<const W: usize, const E: usize>(units: usize, saves: u16) {
    for torn in ALL_TORN {
        for i in 0..=saves {
            let (flash, before) = start::<W, E>(units, i);
            let bench = Bench { before, new: set(1000), torn, bug: Bug::None };
            let report = bench.run(&flash).unwrap_or_else(|why| panic!("{torn:?} {i}: {why}"));
            // The injector fired, once for each byte.
            assert!(report.cuts >= SET_LEN && report.second_cuts > report.cuts, "{report:?}");
            println!("{W} {E} {torn:?} {i}: {report:?}");
        }
    }
}

#[test]
fn words_of_1_byte_and_a_set_that_spans_units() {
    torture::<1, 256>(6, 3);
}

#[test]
fn words_of_4_bytes() {
    torture::<4, 512>(3, 3);
}

#[test]
fn words_of_8_bytes_and_several_sets_in_a_unit() {
    torture::<8, 512>(6, 4);
}

#[test]
fn words_of_16_bytes() {
    torture::<16, 512>(3, 1);
}

#[test]
fn words_of_32_bytes() {
    torture::<32, 1024>(3, 3);
}

#[test]
fn planted_bugs_are_found() {
    for (bug, torn) in [
        (Bug::EraseNewest, CutDamage::Short),
        (Bug::InPlace, CutDamage::Short),
        (Bug::BelieveAnything, CutDamage::Short),
        (Bug::TwoUnits, CutDamage::Fading),
    ] {
        let found = (1..5).find_map(|i| {
            let (flash, before) = start::<8, 512>(3, i);
            let bench = Bench { before, new: set(1000), torn, bug };
            bench.run(&flash).err()
        });
        println!("{bug:?}: {found:?}");
        let found = found.unwrap_or_else(|| panic!("{bug:?} was not found"));
        assert!(found.starts_with("cut at"), "{bug:?}: {found}");
    }
}

#[test]
fn golden_bytes_of_a_set() {
    let values = [[1.0, 0.5, -2.0]].into_iter().collect();
    let set = ParameterSet { config_hash: 0xDEAD_BEEF, values, feed_forward: 1.0 };
    let bytes: [u8; SET_LEN] = set.encode(7);
    assert_eq!(
        bytes[..24],
        [
            7, 0, 0, 0, 0xB3, 3, 1, 0, 0xEF, 0xBE, 0xAD, 0xDE, 0, 0, 0x80, 0x3F, 0, 0, 0, 0x3F, 0,
            0, 0, 0xC0
        ]
    );
    assert!(bytes[24..316].iter().all(|&byte| byte == 0));
    assert_eq!(bytes[316..], crc32c(&bytes[..316]).to_le_bytes());
    assert_eq!(ParameterSet::decode(&bytes), Some((7, set)));
    for blank in [0, 0xFF] {
        assert_eq!(ParameterSet::decode(&[blank; SET_LEN]), None);
    }
}

#[test]
#[cfg(feature = "many-channels")]
fn sets_of_many_channels_are_longer() {
    assert_eq!([1, 24, 25, 64].map(set_len), [320, 320, 800, 800]);
    let mut store = FlashParameters::<_, { set_len(64) }>::mount(NorSimulator::<8, 1024>::blank(3));
    let store = store.as_mut().unwrap();
    for channels in [64, 25, 24, 1] {
        store.save(&set_of(channels, 7)).unwrap();
        assert_eq!(store.load(), Some(set_of(channels, 7)));
    }
    let mut short = Store::mount(NorSimulator::<8, 512>::blank(3)).unwrap();
    assert_eq!(short.save(&set_of(25, 7)), Err(StoreError::OutOfRange));
    assert_eq!(short.load(), None);
    let bytes: [u8; set_len(64)] = set_of(64, 7).encode(9);
    let last = 12 + 4 * PARAMETERS * 64;
    assert_eq!(bytes[4..8], [0xB3, 3, 64, 1]);
    assert_eq!(bytes[last..last + 4], (7.0_f32 / 256.0).to_le_bytes());
    assert_eq!(bytes[796..], crc32c(&bytes[..796]).to_le_bytes());
}

#[test]
fn flash_that_cannot_hold_a_set_is_refused() {
    let refused = |result: Result<_, GeometryError>| result.err();
    assert_eq!(
        refused(Store::mount(NorSimulator::<8, 256>::blank(5)).map(|_| ())),
        Some(GeometryError::Capacity)
    );
    assert_eq!(
        refused(Store::mount(NorSimulator::<64, 512>::blank(3)).map(|_| ())),
        Some(GeometryError::WordSize)
    );
}

/// Flash may fail to read a set at one boot and read it at the next. A set that was saved in between must have the higher
/// generation, wherever in the log both are.
#[test]
fn a_set_that_comes_back_is_older_than_what_was_saved_without_it() {
    for saves in 1..=20 {
        let (flash, _) = start::<8, 1024>(3, saves);
        let newest: [u8; SET_LEN] = set(saves - 1).encode(saves.into());
        let place = flash.mapped().windows(SET_LEN).position(|bytes| bytes == newest).unwrap();
        let mut flash = flash;
        flash.hide(place, true);
        let mut store = Store::mount(flash).unwrap();
        assert_eq!(store.load(), saves.checked_sub(2).map(set));
        store.save(&set(1000)).unwrap();
        let mut flash = store.into_flash();
        flash.hide(place, false);
        assert_eq!(Store::mount(flash).unwrap().load(), Some(set(1000)), "{saves}");
    }
}

/// Occasional writes fail without a power cut: sets whose save succeeded are there.
#[test]
fn a_flash_with_bad_days_keeps_what_it_said_it_keeps() {
    let mut store = Store::mount(NorSimulator::<8, 2048>::blank(3)).unwrap();
    store.flash.failing = Some(3);
    let mut kept = None;
    for i in 0..200 {
        if store.save(&set(i)).is_ok() {
            kept = Some(set(i));
        }
        assert_eq!(store.load(), kept);
    }
    assert!(kept.is_some() && store.into_flash().overwrites == 0);
}

proptest! {
    /// Random content of the flash must not cause a panic, and a set saved afterwards must be there.
    #[test]
    fn any_flash_can_be_taken_into_use(
        cells in prop::collection::vec(any::<u8>(), 1536),
        spoilt in prop::collection::vec(any::<u16>(), 0..4),
        blank_from in 0usize..1536,
    ) {
        let mut flash = NorSimulator::<8, 512>::with(cells);
        flash.cells()[blank_from..].fill(0xFF);
        spoilt.iter().for_each(|&at| flash.make_unreadable(usize::from(at) % 1536));
        let mut store = Store::mount(flash).unwrap();
        prop_assert_eq!(store.load(), None);
        store.save(&set(5)).unwrap();
        prop_assert_eq!(Store::mount(store.into_flash()).unwrap().load(), Some(set(5)));
    }
}
