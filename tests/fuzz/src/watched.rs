//! Flash of the store's tests, with switches that remain accessible while a store owns the flash.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use rollwalk_firmware::store::MappedFlash;

use crate::flash::nor::{CutDamage, NorSimulator};

/// Flash with words of 8 bytes, and with units that are small enough for an input to reach all of them.
pub type Cells = NorSimulator<8, 256>;

/// Switches that take effect with the next operation.
#[derive(Default)]
struct Switches {
    has_power: Cell<bool>,
    cut: RefCell<Option<Option<(CutDamage, usize)>>>,
    failing: Cell<Option<Option<u64>>>,
}

/// Power supply of the flash, and control of its faults.
#[derive(Clone)]
pub struct Power(Rc<Switches>);

impl Power {
    /// True if there is power.
    pub fn get(&self) -> bool {
        self.0.has_power.get()
    }

    /// Cuts the power after `bytes` bytes of writing and erasing.
    pub fn cut_after(&self, torn: CutDamage, bytes: usize) {
        self.0.cut.replace(Some(Some((torn, bytes))));
    }

    /// Keeps the power on.
    pub fn keep(&self) {
        self.0.cut.replace(Some(None));
    }

    /// Makes one write in `rate` fail; `None` for no failures.
    pub fn fail_writes(&self, rate: Option<u64>) {
        self.0.failing.set(Some(rate));
    }
}

pub struct Watched {
    cells: Cells,
    power: Power,
    cycles: u32,
}

impl Watched {
    /// Creates flash with a content, and its power supply.
    pub fn new(cells: Vec<u8>) -> (Self, Power) {
        let power = Power(Rc::default());
        power.0.has_power.set(true);
        (Self { cells: Cells::with(cells), power: power.clone(), cycles: 0 }, power)
    }

    /// Makes a word permanently unreadable.
    pub fn spoil(&mut self, at: usize) {
        self.cells.make_unreadable(at % self.cells.capacity());
    }

    /// Restores the power. Words that were fading since the previous cut are lost.
    pub fn power_cycle(&mut self) {
        if self.cycles > 0 {
            self.cells.fade();
        }
        self.cycles += 1;
        self.cells.power_on();
        self.power.0.has_power.set(true);
    }

    fn operate<T>(&mut self, operation: impl FnOnce(&mut Cells) -> T) -> T {
        let switches = &self.power.0;
        if let Some(cut) = switches.cut.borrow_mut().take() {
            let (torn, fuel) =
                cut.map_or((CutDamage::Short, None), |(torn, fuel)| (torn, Some(fuel)));
            self.cells.arm(torn, fuel);
        }
        if let Some(rate) = switches.failing.take() {
            self.cells.failing = rate;
        }
        let result = operation(&mut self.cells);
        switches.has_power.set(self.cells.has_power());
        result
    }
}

impl ErrorType for Watched {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Watched {
    const READ_SIZE: usize = Cells::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        self.operate(|cells| cells.read(offset, bytes))
    }

    fn capacity(&self) -> usize {
        self.cells.capacity()
    }
}

impl NorFlash for Watched {
    const WRITE_SIZE: usize = Cells::WRITE_SIZE;
    const ERASE_SIZE: usize = Cells::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        self.operate(|cells| cells.erase(from, to))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        self.operate(|cells| cells.write(offset, bytes))
    }
}

impl MappedFlash for Watched {
    fn mapped(&self) -> &[u8] {
        self.cells.mapped()
    }
}
