//! Two libraries in NOR flash: one in use, the other being received or on trial.
//!
//! `docs/formats/library-store.md` describes states and recovery, [`record`](super::record) the layout. Every change of state is
//! one record of the [log](super::log), written after the bytes that it refers to. The slot of the confirmed library is never
//! written.
//!
//! Every call takes a short time: a transfer erases each unit when it reaches it, not all of them at the beginning.
//!
//! | request | writes, in this order | erases at most |
//! |---|---|---|
//! | BEGIN | confirmation of the only library, if it is on trial; record: receiving; erasure of the slot's footers | 1 unit, 1 of the log |
//! | BLOCK | erasure of a unit before its first byte; words; record `have` after each full unit and at the end | 1 unit, 1 of the log |
//! | FINISH | nothing; if FINISH refuses the library, record: no candidate | 1 of the log |
//! | ACTIVATE | record: trial, boots left | 1 of the log |
//! | confirmation | footer; record: confirmed | 1 of the log |
//! | start, on trial | record: boots left − 1, or no candidate | 1 of the log |
//!
//! The bound of BLOCK is for units of 512 bytes and more, and blocks that start at multiples of 512.

use super::log::Log;
use super::record::{Candidate, Footer, Image, RECORD_LEN, StoreState};
use super::slots::{self, GeometryError, MappedFlash};
use super::{LibraryStore, StoreError};

/// Transfer in progress: number of bytes in flash, and bytes that do not fill a word yet.
#[derive(Clone, Copy, Debug)]
struct Upload {
    /// Number of bytes in flash: a multiple of the word length until the transfer is complete.
    written: usize,
    word: [u8; RECORD_LEN],
    in_word: usize,
}

/// Library store in NOR flash, with two slots.
#[derive(Debug)]
pub struct FlashStore<F> {
    pub(super) flash: F,
    pub(super) log: Log,
    pub(super) state: StoreState,
    /// Library in use, read and found intact.
    pub(super) active: Option<Image>,
    upload: Option<Upload>,
    /// True if the whole candidate was read and found intact.
    sealed: bool,
    trial_boots: u8,
}

impl<F: MappedFlash> FlashStore<F> {
    /// Restores the state after a reset, and counts this boot if a library is on trial.
    ///
    /// All of `flash` belongs to the store. A library on trial that is not confirmed within `trial_boots` boots is rolled back
    /// to the previous one.
    pub fn mount(mut flash: F, trial_boots: u8) -> Result<Self, GeometryError> {
        slots::check(&flash)?;
        let (mut log, state) = Log::open(&mut flash, slots::LOG_UNITS, F::ERASE_SIZE);
        let state = state.unwrap_or_else(|| {
            let (confirmed, generation) = slots::newest_by_footers(&mut flash);
            log.generation = generation;
            StoreState { confirmed, candidate: Candidate::None }
        });
        let mut store =
            Self { flash, log, state, active: None, upload: None, sealed: false, trial_boots };
        store.choose();
        Ok(store)
    }

    /// Returns the flash.
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// Selects the library to use after a reset.
    fn choose(&mut self) {
        if let Candidate::Trial { len, digest, boots_left } = self.state.candidate {
            let image = self.state.candidate_image().filter(|&i| self.is_intact(i));
            if let Some(image) = image {
                // Without a library to roll back to, boots are not counted.
                if self.intact_confirmed().is_none() {
                    self.active = Some(image);
                    return;
                }
                // The boot is counted before the library is used, so that a library that crashes the controller is
                // rolled back too.
                if let Some(boots_left) = boots_left.checked_sub(1) {
                    let candidate = Candidate::Trial { len, digest, boots_left };
                    if self.save(StoreState { candidate, ..self.state }).is_ok() {
                        self.active = Some(image);
                        return;
                    }
                }
            }
            self.drop_candidate();
        }
        self.use_confirmed();
    }

    fn is_intact(&mut self, image: Image) -> bool {
        slots::is_intact(&mut self.flash, image)
    }

    fn intact_confirmed(&mut self) -> Option<Image> {
        self.state.confirmed.filter(|&image| self.is_intact(image))
    }

    fn use_confirmed(&mut self) {
        self.active = self.intact_confirmed();
        if self.active.is_none()
            && let (Some(image), _) = slots::newest_by_footers(&mut self.flash)
        {
            // The confirmed library is damaged: the newest intact one takes its place.
            self.active = Some(image);
            self.state = StoreState { confirmed: Some(image), candidate: Candidate::None };
        }
    }

    /// Records `state` in flash and adopts it.
    fn save(&mut self, state: StoreState) -> Result<(), StoreError> {
        self.log.append(&mut self.flash, &state)?;
        self.state = state;
        Ok(())
    }

    /// Drops the candidate. In RAM it is dropped even if the flash fails.
    fn drop_candidate(&mut self) {
        let state = StoreState { candidate: Candidate::None, ..self.state };
        let _ = self.save(state);
        self.state = state;
        self.upload = None;
        self.sealed = false;
    }

    /// Appends bytes to the incoming library.
    fn append(&mut self, upload: &mut Upload, data: &[u8], len: usize) -> Result<(), StoreError> {
        for &byte in data {
            if let Some(place) = upload.word.get_mut(upload.in_word) {
                *place = byte;
            }
            upload.in_word = upload.in_word.saturating_add(1);
            if upload.in_word >= RECORD_LEN {
                self.flush(upload, len)?;
            }
        }
        if upload.in_word > 0 && upload.written.saturating_add(upload.in_word) >= len {
            self.flush(upload, len)?;
        }
        Ok(())
    }

    /// Writes a word. The first word of a unit erases the unit, and the last word records the progress.
    fn flush(&mut self, upload: &mut Upload, len: usize) -> Result<(), StoreError> {
        let start = slots::start(&self.flash, self.state.candidate_slot());
        let at = start.saturating_add(upload.written);
        if upload.written.is_multiple_of(F::ERASE_SIZE) {
            slots::erase_unit(&mut self.flash, at).ok_or(StoreError::Medium)?;
        }
        slots::program(&mut self.flash, at, &upload.word).ok_or(StoreError::Medium)?;
        upload.written = upload.written.saturating_add(upload.in_word).min(len);
        upload.word = [0xFF; RECORD_LEN];
        upload.in_word = 0;
        if upload.written >= len || upload.written.is_multiple_of(F::ERASE_SIZE) {
            self.note(upload.written)?;
        }
        Ok(())
    }

    /// Records the progress, so that the transfer can be resumed after a reset.
    fn note(&mut self, written: usize) -> Result<(), StoreError> {
        let Candidate::Receiving { len, digest, .. } = self.state.candidate else {
            return Err(StoreError::OutOfRange);
        };
        let have = u32::try_from(written).unwrap_or(u32::MAX).min(len);
        self.save(StoreState {
            candidate: Candidate::Receiving { len, digest, have },
            ..self.state
        })
    }
}

impl<F: MappedFlash> LibraryStore for FlashStore<F> {
    fn capacity(&self) -> usize {
        slots::capacity(&self.flash)
    }

    fn begin(&mut self, len: usize, digest: u32) -> Result<usize, StoreError> {
        let announced = u32::try_from(len).map_err(|_| StoreError::OutOfRange)?;
        if len > self.capacity() {
            return Err(StoreError::OutOfRange);
        }
        self.upload = None;
        self.sealed = false;
        let have = match self.state.candidate {
            Candidate::Receiving { len: l, digest: c, have } if (l, c) == (announced, digest) => {
                usize::try_from(have).unwrap_or(0)
            }
            _ => 0,
        };
        // A transfer resumes only after whole erase units, because the next one is erased first.
        let resumes = have == len || have.is_multiple_of(F::ERASE_SIZE);
        let written = if resumes { have } else { 0 };
        if written == 0 {
            // If the library has no predecessor for a roll-back, it stays, in case the incoming library is refused.
            if self.on_trial() && self.active.is_some() && self.intact_confirmed().is_none() {
                self.confirm()?;
            }
            let candidate = Candidate::Receiving { len: announced, digest, have: 0 };
            self.save(StoreState { candidate, ..self.state })?;
            // Another library on trial is being overwritten; the confirmed one is used instead.
            self.active = self.intact_confirmed();
            slots::erase_footers(&mut self.flash, self.state.candidate_slot())
                .ok_or(StoreError::Medium)?;
        }
        self.upload = Some(Upload { written, word: [0xFF; RECORD_LEN], in_word: 0 });
        Ok(written)
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StoreError> {
        let Candidate::Receiving { len, .. } = self.state.candidate else {
            return Err(StoreError::OutOfRange);
        };
        let mut upload = self.upload.ok_or(StoreError::OutOfRange)?;
        let len = usize::try_from(len).unwrap_or(0);
        let here = upload.written.saturating_add(upload.in_word);
        let end = offset.checked_add(data.len()).ok_or(StoreError::OutOfRange)?;
        if offset > here || end > len {
            return Err(StoreError::OutOfRange);
        }
        let new = data.get(here.saturating_sub(offset)..).unwrap_or_default();
        // After a failure only `begin` resumes the transfer, from the last complete unit.
        self.upload = None;
        self.sealed = false;
        self.append(&mut upload, new, len)?;
        self.upload = Some(upload);
        Ok(())
    }

    fn seal(&mut self) -> Result<(), StoreError> {
        if self.sealed {
            return Ok(());
        }
        let image = self.state.candidate_image().filter(|_| self.upload.is_some());
        self.sealed = self.is_intact(image.ok_or(StoreError::NotSealed)?);
        if self.sealed { Ok(()) } else { Err(StoreError::Damaged) }
    }

    fn received(&self) -> &[u8] {
        let image = self.state.candidate_image().filter(|_| self.sealed);
        image.map_or(&[], |image| slots::bytes_of(&self.flash, image))
    }

    fn activate(&mut self) -> Result<(), StoreError> {
        let image = self.state.candidate_image().filter(|_| self.sealed);
        let image = image.ok_or(StoreError::NotSealed)?;
        if let Candidate::Receiving { len, digest, .. } = self.state.candidate {
            let candidate = Candidate::Trial { len, digest, boots_left: self.trial_boots };
            self.save(StoreState { candidate, ..self.state })?;
        }
        self.active = Some(image);
        Ok(())
    }

    fn abandon(&mut self) {
        if let Candidate::Receiving { .. } = self.state.candidate {
            self.drop_candidate();
        }
    }

    fn bytes(&self) -> &[u8] {
        self.active.map_or(&[], |image| slots::bytes_of(&self.flash, image))
    }

    fn keeps_library(&self) -> bool {
        true
    }

    fn on_trial(&self) -> bool {
        matches!(self.state.candidate, Candidate::Trial { .. })
    }

    fn confirm(&mut self) -> Result<(), StoreError> {
        if !self.on_trial() {
            return Ok(());
        }
        let image = self.state.candidate_image().filter(|&image| Some(image) == self.active);
        let confirmed = image.ok_or(StoreError::NotSealed)?;
        let Image { slot, len, digest } = confirmed;
        let generation = self.log.generation.saturating_add(1);
        slots::write_footer(&mut self.flash, slot, Footer { generation, len, digest });
        self.save(StoreState { confirmed: Some(confirmed), candidate: Candidate::None })?;
        self.upload = None;
        self.sealed = false;
        Ok(())
    }

    fn roll_back(&mut self) -> bool {
        if !self.on_trial() {
            return false;
        }
        let Some(confirmed) = self.intact_confirmed() else { return false };
        self.drop_candidate();
        self.active = Some(confirmed);
        true
    }
}
