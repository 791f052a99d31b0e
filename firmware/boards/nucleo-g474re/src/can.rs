//! Classic CAN bus on one FDCAN (RM0440, chapter 44), with the functions that a robot needs.
//!
//! The HAL's driver queues frames and cannot cancel one. This driver differs:
//!
//! - **One frame at a time.** A frame is passed to the hardware when the previous one has been sent. The choice of the frame is
//!   thus made as late as possible, and old set-points do not queue. The hardware repeats an unacknowledged frame until
//!   [`Bus::expire`] or [`Bus::cancel`] cancels it. No frame from before a loss of motor power is sent after it.
//! - **Bus-off lasts.** "If the device enters bus-off, it sets the INIT bit of its own, stopping all bus activities. Once INIT
//!   has been cleared by the CPU, the device waits for 129 occurrences of bus-idle" (44.4.13). Only [`Bus::start`] clears the
//!   bit, after an operator has cleared the stop.
//! - **No interrupts.** The main loop reads frames from the hardware's FIFO of three, which lasts for 300 µs of a fully loaded
//!   bus. Lost frames are counted.

use crate::chip::CRYSTAL_HZ;
use embassy_stm32::can::{Instance, RxPin, TxPin};
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::pac::can::Fdcan;
use embassy_stm32::pac::can::vals::{Anfe, Anfs, Lec, Tfqm};
use embassy_stm32::pac::fdcanram::Fdcanram;
use embassy_stm32::{Peri, pac};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{BusReport, BusState};

/// Maximum numbers of time quanta of segments 1 and 2 of a bit (FDCAN_NBTP).
const MAX_SEGMENTS: (u32, u32) = (256, 128);

/// Flag of a 29-bit identifier, in the first word of an element.
const EXTENDED: u32 = 1 << 30;

/// Length of a FIFO element or transmit buffer in message RAM, words (44.3.8, 44.3.9).
const ELEMENT_WORDS: usize = 18;
/// Index of the final element of the FIFO.
const LAST_ELEMENT: u8 = 2;
/// Bits of all three transmit buffers.
const ALL_BUFFERS: u32 = 0b111;

/// Registers and message RAM of an FDCAN.
#[derive(Clone, Copy)]
pub struct Port {
    regs: Fdcan,
    ram: Fdcanram,
}

/// FDCAN1 to FDCAN3.
pub const PORTS: [Port; 3] = [
    Port { regs: pac::FDCAN1, ram: pac::FDCANRAM1 },
    Port { regs: pac::FDCAN2, ram: pac::FDCANRAM2 },
    Port { regs: pac::FDCAN3, ram: pac::FDCANRAM3 },
];

/// Disconnects all FDCANs from their buses. Drops a pending frame.
pub fn silence() {
    for Port { regs, .. } in PORTS {
        regs.cccr().modify(|w| w.set_init(true));
    }
}

/// Connects two pins to an FDCAN; the types admit only suitable pins.
pub fn connect<T: Instance>(rx: Peri<'static, impl RxPin<T>>, tx: Peri<'static, impl TxPin<T>>) {
    let (rx_function, tx_function) = (rx.af_num(), tx.af_num());
    // Pulled up: without a transceiver the bus reads as idle.
    let mut rx = Flex::new(rx);
    rx.set_as_af_unchecked(rx_function, AfType::input(Pull::Up));
    let mut tx = Flex::new(tx);
    tx.set_as_af_unchecked(tx_function, AfType::output(OutputType::PushPull, Speed::VeryHigh));
    // The pins stay connected. Dropping `rx` and `tx` would disconnect them.
    core::mem::forget((rx, tx));
}

/// Lengths of the segments of a bit, in quanta of the crystal's clock.
#[derive(Clone, Copy)]
struct Timing {
    segment_1: u32,
    /// Quanta after the sample point, which is at 87.5 % as in CiA 601-3. Their number also limits the jump of a
    /// resynchronisation.
    segment_2: u32,
}

impl Timing {
    /// Timing for a bit rate; `None` if the bit is not a whole number of quanta. Robot files permit 125 kbit/s to 1 Mbit/s,
    /// which are 192 to 24 quanta.
    fn at(bit_rate: u32) -> Option<Self> {
        let quanta = CRYSTAL_HZ.checked_div(bit_rate)?;
        let segment_2 = (quanta + 4) / 8;
        // The first quantum synchronises.
        let segment_1 = quanta.checked_sub(1 + segment_2)?;
        let whole = CRYSTAL_HZ.is_multiple_of(bit_rate) && segment_1 > 0 && segment_2 > 0;
        let fits = segment_1 <= MAX_SEGMENTS.0 && segment_2 <= MAX_SEGMENTS.1;
        (whole && fits).then_some(Self { segment_1, segment_2 })
    }
}

pub struct Bus {
    port: Port,
    timing: Timing,
    /// Time at which the waiting frame was passed to the hardware, µs.
    waits_since_us: u64,
    report: BusReport,
}

impl Bus {
    /// Joins the bus of a port; `None` if the crystal cannot produce the bit rate.
    pub fn new(port: Port, bit_rate: u32) -> Option<Self> {
        let timing = Timing::at(bit_rate)?;
        let bus = Self { port, timing, waits_since_us: 0, report: BusReport::default() };
        bus.start();
        Some(bus)
    }

    /// Sets up the hardware and joins the bus. Drops pending frames.
    ///
    /// After bus-off, the hardware joins once it has seen 129 times 11 recessive bits.
    pub fn start(&self) {
        let Port { regs, ram } = self.port;
        let Timing { segment_1, segment_2 } = self.timing;
        // 44.3.4, "Software initialization": INIT, then CCE, which resets the requests to transmit and
        // both FIFOs.
        regs.cccr().modify(|w| w.set_init(true));
        while !regs.cccr().read().init() {}
        regs.cccr().modify(|w| w.set_cce(true));
        for word in 0..ELEMENT_WORDS * 3 {
            ram.rxfifo0(word).write_value(0);
            ram.txbuf(word).write_value(0);
        }
        regs.cccr().modify(|w| {
            // After a failed access to message RAM, hardware sets this bit, and the controller stops sending.
            w.set_asm(false);
            w.set_fdoe(false);
            w.set_brse(false);
            // After a lost arbitration or an error, the frame is repeated, because it is still the latest. `expire` limits the
            // time.
            w.set_dar(false);
        });
        regs.nbtp().write(|w| {
            w.set_nbrp(0);
            w.set_ntseg1(segment_1.saturating_sub(1) as u8);
            w.set_ntseg2(segment_2.saturating_sub(1) as u8);
            w.set_nsjw(segment_2.saturating_sub(1) as u8);
        });
        regs.rxgfc().write(|w| {
            w.set_anfs(Anfs::ACCEPT_FIFO_0);
            w.set_anfe(Anfe::ACCEPT_FIFO_0);
            w.set_rrfs(true);
            w.set_rrfe(true);
        });
        // A queue: "transmit cancellation is not intended for Tx FIFO operation" (44.3.6).
        regs.txbc().write(|w| w.set_tfqm(Tfqm::QUEUE));
        // Clears CCE as well.
        regs.cccr().modify(|w| w.set_init(false));
    }

    /// Returns the next received frame.
    pub fn receive(&mut self) -> Option<Frame> {
        let Port { regs, ram } = self.port;
        let fifo = regs.rxfs(0).read();
        if fifo.rfl() {
            self.report.lost = self.report.lost.saturating_add(1);
            // Clearing this interrupt flag also clears the flag in the FIFO's status.
            regs.ir().write(|w| w.set_rfl(0, true));
        }
        if fifo.ffl() == 0 {
            return None;
        }
        let index = fifo.fgi().min(LAST_ELEMENT);
        let word = |n| ram.rxfifo0(usize::from(index) * ELEMENT_WORDS + n).read();
        let (header, length) = (word(0), (word(1) >> 16) & 0xF);
        let mut data = [0; 8];
        let (low, high) = data.split_at_mut(4);
        low.copy_from_slice(&word(2).to_le_bytes());
        high.copy_from_slice(&word(3).to_le_bytes());
        regs.rxfa(0).write(|w| w.set_fai(index));
        // Remote frames are filtered out. A length above 8 means 8.
        let data = data.get(..length as usize).unwrap_or(&data);
        if header & EXTENDED == 0 {
            Frame::standard(((header >> 18) & 0x7FF) as u16, data)
        } else {
            Frame::extended(header & 0x1FFF_FFFF, data)
        }
    }

    /// True if a frame can be sent now.
    pub fn is_free(&self) -> bool {
        let regs = self.port.regs;
        !regs.cccr().read().init() && regs.txbrp().read().0 & ALL_BUFFERS == 0
    }

    /// Sends a frame. Requires [`Self::is_free`].
    pub fn send(&mut self, now_us: u64, frame: &Frame) {
        let Port { regs, ram } = self.port;
        let mut data = [0; 8];
        data.iter_mut().zip(frame.data()).for_each(|(slot, byte)| *slot = *byte);
        let [a, b, c, d, e, f, g, h] = data;
        let words = [
            match (frame.standard_id(), frame.extended_id()) {
                (_, Some(id)) => EXTENDED | id,
                (id, None) => u32::from(id.unwrap_or_default()) << 18,
            },
            (frame.data().len() as u32) << 16,
            u32::from_le_bytes([a, b, c, d]),
            u32::from_le_bytes([e, f, g, h]),
        ];
        // Any buffer without a request will do (44.3.6, "Tx queue").
        for (n, word) in words.into_iter().enumerate() {
            ram.txbuf(n).write_value(word);
        }
        self.waits_since_us = now_us;
        regs.txbar().write(|w| w.set_ar(0, true));
    }

    /// Cancels a frame that has not been sent. A frame that is being sent is completed, but not repeated (44.3.6, "Transmit
    /// cancellation").
    pub fn cancel(&mut self) {
        let regs = self.port.regs;
        let waiting = regs.txbrp().read().0 & ALL_BUFFERS;
        if waiting != 0 {
            regs.txbcr().write(|w| w.0 = waiting);
        }
    }

    /// Cancels a frame that has waited for longer than `patience_us`.
    pub fn expire(&mut self, now_us: u64, patience_us: u64) {
        if now_us.saturating_sub(self.waits_since_us) > patience_us {
            self.cancel();
        }
    }

    /// State of the bus. Call it once in each control period.
    pub fn report(&mut self) -> BusReport {
        let regs = self.port.regs;
        // A read clears the last error (44.4.13). No other code reads it.
        let status = regs.psr().read();
        let control = regs.cccr().read();
        let before = self.report.state;
        self.report.state = match status.lec() {
            _ if control.init() || control.asm() => BusState::Off,
            _ if !status.ep() => BusState::Active,
            Lec::ACK => BusState::NotAcknowledged,
            // No frame was sent since the last read.
            Lec::NO_CHANGE if before == BusState::NotAcknowledged => before,
            _ => BusState::Passive,
        };
        let errors = regs.ecr().read();
        self.report.transmit_errors = errors.tec();
        self.report.receive_errors = errors.rec();
        self.report
    }
}
