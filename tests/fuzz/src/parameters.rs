//! Fuzz target for the memory of gains and limits in flash, with any content, power cuts and failing writes. A loaded set must
//! be the set saved most recently, or the set that was being saved when the power failed.

use arbitrary::{Result, Unstructured};
use rollwalk_firmware::store::{FlashParameters, ParameterSet, ParameterStore};
use rollwalk_protocol::crc::crc32c;

use crate::flash::nor::{ALL_TORN, CutDamage};
use crate::watched::{Power, Watched};

const UNIT: usize = 256;
/// Number of units of the log; each has two erase units.
const LOG_UNITS: usize = 3;
const FLASH_LEN: usize = LOG_UNITS * 2 * UNIT;
/// Size of a set of at most 24 channels, bytes.
const SET_LEN: usize = 320;
const DEEDS: usize = 60;

type Store = FlashParameters<Watched, SET_LEN>;

/// Parameter set with a number. Sets differ from one another, and have from no channel to all channels.
fn set(number: u8) -> ParameterSet {
    let value = |channel: u8, i: u8| f32::from(number ^ channel) + f32::from(i) / 4.0;
    let channels = number % 25;
    let values = (0..channels).map(|channel| [0, 1, 2].map(|i| value(channel, i))).collect();
    let feed_forward = f32::from(number) / 255.0;
    ParameterSet { config_hash: u32::from(number) * 0x0101_0101, values, feed_forward }
}

struct Bench {
    /// Store; `None` only while it is being mounted.
    store: Option<Store>,
    power: Power,
    /// Sets that may be loaded; `None` for foreign flash, whose content is unknown.
    allowed: Option<Vec<Option<ParameterSet>>>,
}

impl Bench {
    fn new(cells: Vec<u8>, unreadable: &[u16], foreign: bool) -> Self {
        let (mut flash, power) = Watched::new(cells);
        unreadable.iter().for_each(|&at| flash.spoil(at.into()));
        let store = Store::mount(flash).expect("sound geometry");
        Self { store: Some(store), power, allowed: (!foreign).then(|| vec![None]) }
    }

    fn store(&mut self) -> &mut Store {
        self.store.as_mut().expect("mounted")
    }

    fn mount(&mut self) {
        let mut flash = self.store.take().expect("mounted").into_flash();
        if !self.power.get() {
            flash.power_cycle();
        }
        self.store = Some(Store::mount(flash).expect("sound geometry"));
    }

    fn check(&mut self) {
        if !self.power.get() {
            self.mount();
        }
        let loaded = self.store().load();
        if let Some(allowed) = &self.allowed {
            assert!(allowed.contains(&loaded), "nobody saved {loaded:?}");
        }
    }

    fn save(&mut self, number: u8) {
        let set = set(number);
        let saved = self.store().save(&set).is_ok();
        if saved && self.power.get() {
            self.allowed = Some(vec![Some(set)]);
        } else if let Some(allowed) = &mut self.allowed {
            // A refused set leaves the previous one; an interrupted set leaves either.
            allowed.push(Some(set));
        }
    }
}

/// Flash with runs of bytes at various offsets. If `repaired`, checksums are corrected where sets may be.
fn cells(u: &mut Unstructured<'_>, repaired: bool) -> Result<Vec<u8>> {
    let mut cells = vec![0xFF; FLASH_LEN];
    for _ in 0..u.arbitrary::<u8>()? % 8 {
        let at = 32 * usize::from(u.arbitrary::<u8>()?) % FLASH_LEN;
        let len = usize::from(u.arbitrary::<u8>()?).min(u.len()).min(FLASH_LEN - at);
        cells[at..][..len].copy_from_slice(u.bytes(len)?);
    }
    if repaired {
        for unit in cells.chunks_exact_mut(FLASH_LEN / LOG_UNITS) {
            let set = &mut unit[..SET_LEN];
            // No flash lasts for 2³¹ sets.
            set[3] &= 0x7F;
            set[4..6].copy_from_slice(&[0xB3, 3]);
            set[7] = 0;
            let crc = crc32c(&set[..SET_LEN - 4]);
            set[SET_LEN - 4..].copy_from_slice(&crc.to_le_bytes());
        }
    }
    Ok(cells)
}

fn play(u: &mut Unstructured<'_>) -> Result<()> {
    let how = u.arbitrary::<u8>()?;
    let mut bench = if how & 1 == 0 {
        Bench::new(vec![0xFF; FLASH_LEN], &[], false)
    } else {
        let cells = cells(u, how & 2 != 0)?;
        let spoilt: [u16; 3] = u.arbitrary()?;
        Bench::new(cells, if how & 4 != 0 { &spoilt } else { &[] }, true)
    };
    bench.check();
    for _ in 0..DEEDS {
        if u.is_empty() {
            break;
        }
        match u.arbitrary::<u8>()? % 6 {
            0 | 1 => bench.save(u.arbitrary()?),
            2 => bench.mount(),
            3 | 4 => {
                let torn: CutDamage = *u.choose(&ALL_TORN)?;
                bench.power.cut_after(torn, usize::from(u.arbitrary::<u16>()? % 1000));
            }
            _ => {
                let rate = u64::from(u.arbitrary::<u8>()?);
                bench.power.fail_writes((rate > 2).then_some(rate));
            }
        }
        bench.check();
    }
    bench.power.fail_writes(None);
    bench.power.keep();
    bench.mount();
    bench.check();
    // After any history, the store accepts a set, and keeps it.
    for number in [7, 24] {
        let last = set(number);
        bench.store().save(&last).expect("flash that works again");
        bench.mount();
        assert_eq!(bench.store().load(), Some(last));
    }
    Ok(())
}

/// Runs operations on a memory; the first byte selects the flash.
pub fn run(data: &[u8]) {
    // An error means that a stimulus was cut off.
    let _ = play(&mut Unstructured::new(data));
}

/// Seeds with saved sets, with interrupted saves, and with a set in foreign flash.
pub fn seeds() -> Vec<Vec<u8>> {
    let saves = [0, 3, 0, 24, 2, 0, 9, 2];
    let mut seeds = vec![[&[0][..], &saves].concat()];
    for fuel in [5u16, 100, 400, 600] {
        for torn in 0..5 {
            let cut = [&[3, torn][..], &fuel.to_le_bytes()].concat();
            seeds.push([&[0][..], &saves, &cut, &[0, 5, 2, 0, 6, 2]].concat());
        }
    }
    let found = [9, 0, 0, 0, 0xB3, 3, 24, 0, 1, 2, 3, 4];
    for how in [1, 3, 7] {
        let runs = [&[2, 0, found.len() as u8][..], &found, &[16, 12], &found].concat();
        seeds.push([&[how][..], &runs, &[0, 1, 2, 0, 9, 0], &saves].concat());
    }
    seeds
}
