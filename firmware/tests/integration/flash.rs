//! Flash without failures, with the units and words of an STM32G4, and the life of a library in it. The tests of the store
//! itself cover failures.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

use rollwalk_firmware::store::{FlashParameters, FlashStore, LibraryStore, MappedFlash};
use rollwalk_protocol::crc::file_digest;
use rollwalk_protocol::wire::transport::{MAX_BLOCK, TransferResult};
use rollwalk_protocol::wire::{Action, Request, State};

use crate::rig::Rig;
use crate::robot::*;
use crate::transfer::{flash, result};

const TRIAL_BOOTS: u8 = 3;

pub struct Flash(Vec<u8>);

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        bytes.copy_from_slice(&self.0[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = 2048;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        self.0[from as usize..to as usize].fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        let place = &mut self.0[offset as usize..][..bytes.len()];
        place.iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte);
        Ok(())
    }
}

impl MappedFlash for Flash {
    fn mapped(&self) -> &[u8] {
        &self.0
    }
}

/// Store that is blank or contains a confirmed library.
pub fn store(library: Option<&[u8]>) -> FlashStore<Flash> {
    let mut store = FlashStore::mount(Flash(vec![0xFF; 18 * 2048]), TRIAL_BOOTS).unwrap();
    if let Some(bytes) = library {
        store.begin(bytes.len(), file_digest(bytes)).unwrap();
        store.write(0, bytes).unwrap();
        store.seal().unwrap();
        store.activate().unwrap();
        store.confirm().unwrap();
    }
    store
}

/// Blank parameter store.
pub fn parameters() -> FlashParameters<Flash> {
    FlashParameters::mount(Flash(vec![0xFF; 3 * 2048])).unwrap()
}

/// Stores of library and parameters, mounted again after a power cycle.
pub fn mounted_again(
    (library, parameters): (FlashStore<Flash>, FlashParameters<Flash>),
) -> (FlashStore<Flash>, FlashParameters<Flash>) {
    let library = FlashStore::mount(library.into_flash(), TRIAL_BOOTS).unwrap();
    (library, FlashParameters::mount(parameters.into_flash()).unwrap())
}

fn play_and_return(rig: &mut Rig) {
    rig.arm();
    rig.run_until(State::Ready, 1000);
    let ack = rig.play(CODE_DRIVE);
    rig.run(2 * u32::from(ack.value) + 60);
    assert_eq!(rig.brain.state(), State::Playing);
}

#[test]
fn a_library_that_has_played_is_confirmed_once_disarmed() {
    let mut rig = Rig::booted();
    assert!(!rig.brain.library_on_trial());
    assert_eq!(flash(&mut rig, &library_that_settles()), TransferResult::Ok);
    assert!(rig.brain.library_on_trial());

    // Armed and disarmed again without a motion.
    rig.arm();
    rig.run_until(State::Ready, 1000);
    rig.command(Action::Disarm);
    rig.run_until(State::Disarmed, 2000);
    rig.run(10);
    assert!(rig.brain.library_on_trial());

    // A motion played, but it ended in a fault.
    play_and_return(&mut rig);
    rig.servos[0].powered = false;
    rig.run_until(State::TorqueOff, 2000);
    rig.servos[0].powered = true;
    rig.run(20);
    rig.clear();
    rig.run_until(State::Disarmed, 2000);
    rig.run(50);
    assert!(rig.brain.library_on_trial());

    play_and_return(&mut rig);
    rig.command(Action::Return);
    rig.run_until(State::Ready, 2000);
    assert!(rig.brain.library_on_trial(), "nothing is written while torque is on");
    assert_eq!(rig.brain.confirm_library(), Err(rollwalk_firmware::store::StoreError::NotSealed));
    rig.command(Action::Disarm);
    rig.run_until(State::Disarmed, 2000);
    rig.run(2);
    assert!(!rig.brain.library_on_trial());
}

#[test]
fn the_library_in_use_outlasts_a_transfer() {
    let mut rig = Rig::booted();
    let active = rig.brain.library().unwrap().index().id();
    let next = library_that_settles();
    let begin = Request::Begin { len: next.len() as u32, digest: file_digest(&next) };
    assert_eq!(result(rig.request(&begin)), TransferResult::Ok);
    let block = Request::Block { offset: 0, bytes: &next[..MAX_BLOCK] };
    assert_eq!(result(rig.request(&block)), TransferResult::Ok);
    // A transfer that fails because the library is too long.
    let long = Request::Begin { len: 1 << 20, digest: 1 };
    assert_eq!(result(rig.request(&long)), TransferResult::TooLong);
    assert_eq!(rig.brain.library().unwrap().index().id(), active);
    play_and_return(&mut rig);
    rig.command(Action::Disarm);
    rig.run_until(State::Disarmed, 2000);

    assert_eq!(flash(&mut rig, &next), TransferResult::Ok);
    assert_ne!(rig.brain.library().unwrap().index().id(), active);
    // On trial. A transfer that begins drops the library, and the confirmed library is used again.
    assert_eq!(result(rig.request(&Request::Begin { len: 99, digest: 1 })), TransferResult::Ok);
    assert_eq!(rig.brain.library().unwrap().index().id(), active);
}
