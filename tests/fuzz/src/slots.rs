//! Fuzz target for the library store in flash, with any content, any order of calls, power cuts and unreadable words.
//!
//! The active library must always be one that was stored, and intact. Once a library is confirmed in flash without faults, some
//! library must always be active.

mod forge;

use arbitrary::{Result, Unstructured};
use rollwalk_firmware::store::{FlashStore, LibraryStore, MappedFlash, StoreError};
use rollwalk_protocol::crc::file_digest;

use crate::flash::nor::{ALL_TORN, CutDamage};
use crate::watched::{Power, Watched};
use forge::FLASH_LEN;

const TRIAL_BOOTS: u8 = 3;
/// Maximum number of calls of an input.
const DEEDS: usize = 60;

type Store = FlashStore<Watched>;

/// Contents of five "libraries". The store does not interpret them.
fn library(number: u8) -> Vec<u8> {
    let lens = [300, 7, 256, 900, 513];
    let number = usize::from(number) % lens.len();
    (0..lens[number]).map(|i| (i * (2 * number + 3) + number) as u8).collect()
}

/// Store with its expected state.
struct Bench {
    /// Store; `None` only while it is being mounted.
    store: Option<Store>,
    power: Power,
    allowed: Vec<Vec<u8>>,
    /// Words of foreign flash, which may be checksums of libraries in it.
    found: Vec<u32>,
    /// True if the store may be without an active library.
    may_be_empty: bool,
    /// Candidate of the latest transfer.
    candidate: Vec<u8>,
}

impl Bench {
    /// Store with the confirmed library 0.
    fn sound() -> Self {
        let mut bench = Self::foreign(vec![0xFF; FLASH_LEN], &[]);
        bench.found.clear();
        bench.send(0).expect("flash that works");
        bench.activate().expect("flash that works");
        bench.confirm().expect("flash that works");
        bench.may_be_empty = false;
        bench
    }

    /// Store in flash that contains `cells`, with unreadable words.
    fn foreign(cells: Vec<u8>, unreadable: &[u16]) -> Self {
        let (words, _) = cells.as_chunks::<4>();
        let found = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
        let (mut flash, power) = Watched::new(cells);
        unreadable.iter().for_each(|&at| flash.spoil(at.into()));
        let store = FlashStore::mount(flash, TRIAL_BOOTS).expect("sound geometry");
        let store = Some(store);
        Self { store, power, allowed: vec![], found, may_be_empty: true, candidate: vec![] }
    }

    fn into_cells(self) -> Vec<u8> {
        self.store.expect("mounted").into_flash().mapped().to_vec()
    }

    fn store(&mut self) -> &mut Store {
        self.store.as_mut().expect("mounted")
    }

    /// Mounts the store again, as after a reset or a power cut.
    fn mount(&mut self) {
        let mut flash = self.store.take().expect("mounted").into_flash();
        if !self.power.get() {
            flash.power_cycle();
        }
        self.store = Some(FlashStore::mount(flash, TRIAL_BOOTS).expect("sound geometry"));
    }

    fn check(&mut self) {
        if !self.power.get() {
            self.mount();
        }
        // The power may also have failed while mounting. Then nothing can be checked.
        if !self.power.get() {
            return;
        }
        let bytes = self.store().bytes().to_vec();
        if bytes.is_empty() {
            let empty_image = self.found.contains(&file_digest(&[]));
            assert!(self.may_be_empty || empty_image, "nothing plays any more");
            return;
        }
        let known = self.allowed.contains(&bytes) || self.found.contains(&file_digest(&bytes));
        assert!(known, "{} bytes play that nobody stored", bytes.len());
    }

    fn begin(&mut self, number: u8) -> Result<usize, StoreError> {
        self.candidate = library(number);
        let (len, crc) = (self.candidate.len(), file_digest(&self.candidate));
        let have = self.store().begin(len, crc)?;
        assert!(have <= len);
        Ok(have)
    }

    fn send(&mut self, number: u8) -> Result<(), StoreError> {
        let mut at = self.begin(number)?;
        let bytes = self.candidate.clone();
        while at < bytes.len() {
            let end = bytes.len().min(at + 77);
            self.store().write(at, &bytes[at..end])?;
            at = end;
        }
        self.seal()
    }

    fn seal(&mut self) -> Result<(), StoreError> {
        self.store().seal()?;
        let candidate = self.candidate.clone();
        // Foreign flash may hold a finished transfer that this run did not begin.
        let received = self.store().received().to_vec();
        assert!(received == candidate || self.found.contains(&file_digest(&received)));
        Ok(())
    }

    fn activate(&mut self) -> Result<(), StoreError> {
        let received = self.store().received().to_vec();
        // The power may fail with any answer.
        self.allowed.push(received.clone());
        self.store().activate()?;
        assert_eq!(self.store().bytes(), received);
        Ok(())
    }

    fn confirm(&mut self) -> Result<(), StoreError> {
        let on_trial = self.store().on_trial();
        self.store().confirm()?;
        if on_trial && self.power.get() {
            assert!(!self.store().on_trial());
            let bytes = self.store().bytes().to_vec();
            // In foreign flash, the footer of an older library may remain when this one decays.
            self.allowed = vec![bytes];
        }
        Ok(())
    }

    fn roll_back(&mut self) {
        let on_trial = self.store().on_trial();
        let rolled_back = self.store().roll_back();
        assert!(on_trial || !rolled_back);
        assert!(!rolled_back || !self.store().on_trial());
    }
}

fn play(u: &mut Unstructured<'_>) -> Result<()> {
    let how = u.arbitrary::<u8>()?;
    let mut bench = if how & 1 == 0 {
        Bench::sound()
    } else {
        let cells = forge::cells(u, how & 2 != 0)?;
        let spoilt: [u16; 3] = u.arbitrary()?;
        Bench::foreign(cells, if how & 4 != 0 { &spoilt } else { &[] })
    };
    bench.check();
    for _ in 0..DEEDS {
        if u.is_empty() {
            break;
        }
        let stimulus = u.arbitrary::<u8>()?;
        // The answer is judged by the library that plays.
        let _: Result<(), StoreError> = match stimulus % 12 {
            0 => bench.begin(u.arbitrary()?).map(|_| ()),
            1 | 2 => {
                let (offset, len) = u.arbitrary::<(u16, u8)>()?;
                let candidate = &bench.candidate;
                let offset = usize::from(offset) % (candidate.len() + 2);
                let end = (offset + usize::from(len)).min(candidate.len());
                let data = candidate.get(offset..end).unwrap_or(&[1]).to_vec();
                bench.store().write(offset, &data)
            }
            3 => bench.seal(),
            4 => bench.activate(),
            5 => bench.confirm(),
            6 => {
                bench.roll_back();
                Ok(())
            }
            7 => {
                bench.store().abandon();
                Ok(())
            }
            8 => {
                bench.mount();
                Ok(())
            }
            9 => {
                let torn: CutDamage = *u.choose(&ALL_TORN)?;
                bench.power.cut_after(torn, usize::from(u.arbitrary::<u16>()? % 2000));
                Ok(())
            }
            10 => {
                let rate = u64::from(u.arbitrary::<u8>()?);
                bench.power.fail_writes((rate > 2).then_some(rate));
                Ok(())
            }
            _ => bench.send(u.arbitrary()?).and_then(|()| bench.activate()),
        };
        bench.check();
    }
    bench.power.fail_writes(None);
    bench.mount();
    bench.power.keep();
    bench.check();
    // After any history, the store accepts a library, and keeps it.
    bench.send(4).expect("flash that works again");
    bench.activate().expect("flash that works again");
    bench.mount();
    assert_eq!(bench.store().bytes(), library(4));
    bench.confirm().expect("flash that works again");
    for _ in 0..=TRIAL_BOOTS {
        bench.mount();
        assert_eq!(bench.store().bytes(), library(4));
    }
    Ok(())
}

/// Runs operations on a store; the first byte selects the flash.
pub fn run(data: &[u8]) {
    // An error means that a stimulus was cut off.
    let _ = play(&mut Unstructured::new(data));
}

/// Seeds with successful transfers, with interrupted ones, and with stores in foreign flash.
pub fn seeds() -> Vec<Vec<u8>> {
    let cut = |torn: u8, fuel: u16| [&[9, torn][..], &fuel.to_le_bytes()].concat();
    let (send, confirm, mount) = ([11, 1], [5], [8]);
    let mut seeds = vec![[&[0][..], &send, &confirm, &mount, &[11, 2], &[6], &[8]].concat()];
    for fuel in [5u16, 40, 300, 700] {
        for torn in 0..5 {
            seeds.push([&[0][..], &cut(torn, fuel), &send, &mount, &confirm, &[11, 3, 5]].concat());
        }
    }
    let piecewise =
        [0, 0, 3, 1, 0, 0, 255, 1, 255, 0, 255, 8, 0, 3, 1, 0, 1, 255, 1, 0, 2, 255, 3, 4, 8];
    seeds.push(piecewise.to_vec());
    for repaired in [1, 3, 7] {
        let head = [repaired];
        seeds.push([&head[..], &forge::seed(), &[0, 1, 0, 3, 0, 9], &mount].concat());
    }
    seeds
}
