//! Power fails at every byte of every write and erase while a library is received, tried and confirmed, and again during
//! recovery. After each cut, exactly the old or the new library plays.
//!
//! The test checks itself: every scheduled cut must happen, in writes and in erases, and it must find planted bugs.

use super::nor::{ALL_TORN, CutDamage, NorSimulator};
use super::std::string::String;
use super::std::{format, println};
use super::*;
use crate::store::log::Log;
use crate::store::record::{Candidate, Image, StoreState};
use crate::store::slots::{self, LOG_UNITS};

/// Interval of the tested cuts, bytes. It is higher for Miri, which is a hundred times slower.
const EVERY: usize = if cfg!(miri) { 151 } else { 1 };

/// Planted bug of a store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bug {
    None,
    /// Writes the record of a confirmed library before the data, and accepts it after a reset.
    RecordBeforeData,
    /// Writes the new library to the slot of the confirmed one.
    SlotInUse,
    /// Records a unit as written before writing it.
    NoteBeforeData,
    /// Erases the unit with the newest record when the log moves to the next unit.
    EraseNewestRecord,
}

/// Answers that the host received before the power failed.
#[derive(Clone, Copy, Default)]
struct Progress {
    activating: bool,
    activated: bool,
    confirmed: bool,
}

/// Number of power cuts of each kind.
#[derive(Default, Debug)]
struct CutCounts {
    cuts: usize,
    cut_writes: usize,
    cut_erases: usize,
    second_cuts: usize,
}

struct Bench<const W: usize, const E: usize> {
    old: Vec<u8>,
    new: Vec<u8>,
    torn: CutDamage,
    bug: Bug,
}

impl<const W: usize, const E: usize> Bench<W, E> {
    fn mount(&self, flash: NorSimulator<W, E>) -> FlashStore<NorSimulator<W, E>> {
        let mut store = FlashStore::mount(flash, TRIAL_BOOTS).unwrap();
        if self.bug == Bug::RecordBeforeData
            && let (_, Some(StoreState { confirmed: Some(image), .. })) =
                Log::open(&mut store.flash, LOG_UNITS, E)
        {
            store.active = Some(image);
        }
        store
    }

    /// Sends the new library, activates it, restarts the controller, and confirms the library. Returns the flash as an error if
    /// the power fails.
    #[expect(clippy::result_large_err, reason = "the flash comes back either way")]
    fn live(
        &self,
        flash: NorSimulator<W, E>,
        progress: &mut Progress,
    ) -> Result<NorSimulator<W, E>, NorSimulator<W, E>> {
        let mut store = self.mount(flash);
        if store.bytes() != self.new {
            if self.send(&mut store).is_err() {
                return Err(store.into_flash());
            }
            progress.activating = true;
            self.spoil_log(&mut store);
            if self.bug != Bug::RecordBeforeData && store.activate().is_err() {
                return Err(store.into_flash());
            }
            progress.activated = true;
            store = self.mount(store.into_flash());
        }
        if store.on_trial() {
            self.spoil_log(&mut store);
            if store.confirm().is_err() {
                return Err(store.into_flash());
            }
            progress.confirmed = true;
        }
        let flash = store.into_flash();
        if flash.has_power() { Ok(flash) } else { Err(flash) }
    }

    fn spoil_log(&self, store: &mut FlashStore<NorSimulator<W, E>>) {
        if self.bug == Bug::EraseNewestRecord {
            store.log.forget_the_newest();
        }
    }

    fn send(&self, store: &mut FlashStore<NorSimulator<W, E>>) -> Result<(), StoreError> {
        let (len, digest) = (self.new.len(), file_digest(&self.new));
        match self.bug {
            Bug::None | Bug::EraseNewestRecord => {}
            Bug::RecordBeforeData => return self.send_after_record(store),
            Bug::SlotInUse => store.state.confirmed = None,
            Bug::NoteBeforeData => {
                if store.begin(len, digest)? < E {
                    let have = E as u32;
                    let candidate = Candidate::Receiving { len: len as u32, digest, have };
                    let noted = StoreState { candidate, ..store.state };
                    store.log.append(&mut store.flash, &noted)?;
                }
            }
        }
        self.spoil_log(store);
        send(store, &self.new)
    }

    fn send_after_record(
        &self,
        store: &mut FlashStore<NorSimulator<W, E>>,
    ) -> Result<(), StoreError> {
        let (len, digest) = (self.new.len(), file_digest(&self.new));
        store.begin(len, digest)?;
        let slot = store.state.candidate_slot();
        let image = Image { slot, len: len as u32, digest };
        store.state = StoreState { confirmed: Some(image), candidate: Candidate::None };
        store.log.append(&mut store.flash, &store.state)?;
        let at = slots::start(&store.flash, slot);
        for (i, bytes) in self.new.chunks(32).enumerate() {
            let mut word = [0xFF; 32];
            word[..bytes.len()].copy_from_slice(bytes);
            let erased = if i * 32 % E == 0 {
                slots::erase_unit(&mut store.flash, at + i * 32)
            } else {
                Some(())
            };
            erased
                .and_then(|()| slots::program(&mut store.flash, at + i * 32, &word))
                .ok_or(StoreError::Medium)?;
        }
        Ok(())
    }

    /// Checks the active library after a reset.
    fn judge(&self, flash: &NorSimulator<W, E>, progress: Progress) -> Result<(), String> {
        let store = self.mount(flash.clone());
        let playing = store.bytes();
        let name = match playing {
            _ if playing == self.old => "old",
            _ if playing == self.new => "new",
            [] => return Err("none plays".into()),
            _ => return Err("what plays is neither".into()),
        };
        if !progress.activating && name != "old" {
            return Err("the new one plays before it was activated".into());
        }
        if progress.activated && name != "new" {
            return Err("the new one was activated and does not play".into());
        }
        if progress.confirmed && store.on_trial() {
            return Err("confirmed and yet on trial".into());
        }
        let overwrites = store.into_flash().overwrites;
        if overwrites > 0 {
            return Err(format!("{overwrites} words were written twice"));
        }
        Ok(())
    }

    /// Cuts power at every byte. For each cut, cuts again at every `second_step`th byte of the recovery.
    fn run(&self, start: &NorSimulator<W, E>, second_step: usize) -> Result<CutCounts, String> {
        let mut report = CutCounts::default();
        let mut whole = start.clone();
        whole.arm(self.torn, None);
        let Ok(whole) = self.live(whole, &mut Progress::default()) else {
            return Err("fails without a cut".into());
        };
        for fuel in (0..whole.used).step_by(EVERY) {
            let mut flash = start.clone();
            flash.arm(self.torn, Some(fuel));
            let mut progress = Progress::default();
            let Err(mut flash) = self.live(flash, &mut progress) else {
                return Err(format!("no cut at {fuel} of {}", whole.used));
            };
            assert!(!flash.has_power(), "{:?}: an error without a cut", self.torn);
            report.cuts += 1;
            report.cut_writes += flash.cut_writes;
            report.cut_erases += flash.cut_erases;
            flash.power_on();
            let at = |what| move |why| format!("{what} at {fuel}: {why}");
            self.judge(&flash, progress).map_err(at("cut"))?;
            self.recover(&flash, progress, fuel, second_step, &mut report).map_err(at("cut"))?;
            flash.fade();
            self.judge(&flash, progress).map_err(at("cut that faded"))?;
        }
        Ok(report)
    }

    /// Completes the transfer after a cut, first without and then with a second cut.
    fn recover(
        &self,
        flash: &NorSimulator<W, E>,
        progress: Progress,
        fuel: usize,
        step: usize,
        report: &mut CutCounts,
    ) -> Result<(), String> {
        let mut whole = flash.clone();
        whole.arm(self.torn, None);
        let mut progress_whole = progress;
        let Ok(whole) = self.live(whole, &mut progress_whole) else {
            return Err("does not recover".into());
        };
        let progress_whole = Progress { activating: true, activated: true, ..progress_whole };
        self.judge(&whole, progress_whole)?;
        if step == 0 {
            return Ok(());
        }
        for second in (fuel % step..whole.used).step_by(step) {
            let mut flash = flash.clone();
            flash.arm(self.torn, Some(second));
            let mut progress = progress;
            let Err(mut flash) = self.live(flash, &mut progress) else {
                return Err(format!("no second cut at {second} of {}", whole.used));
            };
            report.second_cuts += 1;
            flash.fade();
            flash.power_on();
            let at = |why| format!("second cut at {second}: {why}");
            self.judge(&flash, progress).map_err(at)?;
            let Ok(flash) = self.live(flash, &mut progress) else {
                return Err(at("does not recover".into()));
            };
            self.judge(&flash, Progress { activating: true, activated: true, ..progress })
                .map_err(at)?;
        }
        Ok(())
    }
}

/// Creates a flash with the old library, and with `turn` additional records in the log.
fn start<const W: usize, const E: usize>(
    old: &[u8],
    new: &[u8],
    turn: usize,
) -> NorSimulator<W, E> {
    let slot_units = (old.len().max(new.len()) + 64).div_ceil(E);
    let mut store = holding(NorSimulator::blank(LOG_UNITS + 2 * slot_units), old);
    for _ in 0..turn {
        store.log.append(&mut store.flash, &store.state).unwrap();
    }
    store.into_flash()
}

fn torture<const W: usize, const E: usize>(frames: usize, turns: usize, second_step: usize) {
    let (frames, turns) = if cfg!(miri) { (10, 1) } else { (frames, turns) };
    let (old, new) = (library(1, frames), library(2, frames));
    for torn in ALL_TORN.into_iter().skip(if cfg!(miri) { 3 } else { 0 }) {
        let bench = Bench { old: old.clone(), new: new.clone(), torn, bug: Bug::None };
        for turn in 0..turns {
            let report = bench.run(&start::<W, E>(&old, &new, turn), second_step);
            let report = report.unwrap_or_else(|why| panic!("{W} {E} {torn:?} {turn}: {why}"));
            // The injector fired, once for each byte, in both kinds of operation.
            assert_eq!(report.cuts, report.cut_writes + report.cut_erases);
            let least = if cfg!(miri) { (0, 1) } else { (new.len(), 2 * E) };
            assert!(report.cut_writes > least.0 && report.cut_erases >= least.1, "{report:?}");
            assert!(second_step == 0 || report.second_cuts > report.cuts, "{report:?}");
            println!("{W} {E} {torn:?} {turn}: {report:?}");
        }
    }
}

#[test]
fn words_of_1_byte() {
    torture::<1, 256>(150, 2, 0);
}

#[test]
fn words_of_4_bytes() {
    torture::<4, 256>(150, 2, 0);
}

#[test]
fn scar_4_power_cuts_within_every_write_and_erase() {
    torture::<8, 256>(150, 8, 0);
}

#[test]
fn words_of_16_bytes() {
    torture::<16, 512>(300, 2, 0);
}

#[test]
fn words_of_32_bytes() {
    torture::<32, 1024>(900, 1, 0);
}

#[test]
fn large_units() {
    torture::<8, 4096>(150, 1, 0);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn a_second_cut_during_recovery() {
    torture::<8, 256>(60, 1, 13);
}

#[test]
fn scar_5_planted_bugs_are_found() {
    for bug in [Bug::RecordBeforeData, Bug::SlotInUse, Bug::NoteBeforeData, Bug::EraseNewestRecord]
    {
        let (old, new) = (library(1, 150), library(2, 150));
        let found = (0..8).find_map(|turn| {
            let bench = Bench { old: old.clone(), new: new.clone(), torn: CutDamage::Garbage, bug };
            bench.run(&start::<8, 256>(&old, &new, turn), 0).err()
        });
        println!("{bug:?}: {found:?}");
        let found = found.unwrap_or_else(|| panic!("{bug:?} was not found"));
        // By a cut, not because the store would not work at all.
        assert!(found.starts_with("cut at"), "{bug:?}: {found}");
    }
}

/// Largest number of bytes that a boot writes and erases: a record, and a unit when the log moves to the next one.
const BOOT: usize = 32 + 256;

#[test]
fn cuts_while_booting_on_trial_only_cost_boots() {
    let (a, b) = (library(1, 60), library(2, 60));
    for torn in ALL_TORN {
        for turn in 0..8 {
            let mut store = holding(start::<8, 256>(&a, &b, turn), &a);
            send(&mut store, &b).unwrap();
            store.activate().unwrap();
            let flash = store.into_flash();
            let mut cuts = 0;
            for fuel in 0..BOOT {
                let mut flash = flash.clone();
                let mut rolled_back = 0;
                for boot in 0..4 * usize::from(TRIAL_BOOTS) {
                    flash.arm(torn, (boot % 2 == 0).then_some(fuel));
                    let store = FlashStore::mount(flash, TRIAL_BOOTS).unwrap();
                    flash = store.flash.clone();
                    if flash.has_power() {
                        assert!(store.bytes() == a || store.bytes() == b, "{torn:?} {turn} {fuel}");
                        rolled_back += usize::from(store.bytes() == a);
                    }
                    flash.fade();
                    flash.power_on();
                }
                cuts += flash.cut_writes + flash.cut_erases;
                assert!(rolled_back > 0, "{torn:?} {turn} {fuel}: never rolled back");
                assert_eq!(flash.overwrites, 0);
            }
            assert!(cuts >= 32, "{torn:?} {turn}: {cuts}");
        }
    }
}
