//! Controller on a Raspberry Pi Pico 2, with two lines of serial servos and the link over USB or UART0.
//!
//! A single loop polls everything in turn, and nothing blocks while torque is on. Interrupts only receive bytes of the lines.
//! Wiring, flashing and testing: `firmware/boards/pico2/README.md`.
#![no_std]
#![no_main]

mod chip;
mod clock;
mod estop;
#[path = "../../fault.rs"]
mod fault;
mod flash;
#[path = "../../host.rs"]
mod host;
#[path = "../../image_keys.rs"]
mod image_keys;
#[path = "../../line.rs"]
mod line;
mod lines;
#[path = "../../link.rs"]
mod link;
#[path = "../../partition.rs"]
mod partition;
#[path = "../../received.rs"]
mod received;
#[path = "../../start.rs"]
mod start;
mod uart;
mod usb;
mod watchdog;

// Module `robot` with configuration and buses.
include!(concat!(env!("OUT_DIR"), "/robot.rs"));

use cortex_m_rt::entry;
use embassy_rp::pac::SIO;
use heapless::Vec;
use rollwalk_firmware::periods::Periods;
use rollwalk_protocol::serial::{BoardReport, Reset};
use rollwalk_protocol::wire::Torque;

use estop::EstopContact;
use host::Host;
use line::Line;
use lines::Sender;
use link::Link;
use start::{Core, ReadyController};
use uart::Uart;
use usb::Usb;
use watchdog::Watchdog;

/// Pin of the board's LED, lit while torque is on.
const LIGHT: usize = 25;

/// Disconnects from the lines.
fn silence() {
    lines::silence();
}

#[entry]
fn main() -> ! {
    let reset = chip::take_reset_cause();
    chip::start();
    chip::output::<LIGHT>();
    let (settings, _) = start::settings(chip::uid());
    let started = start::start(flash::parts(), settings);
    let Some(ReadyController { controller, on_can, on_serial }) = started else { fault::halt() };
    // `apps/board-bench/src/wiring.rs` makes no image for a robot with other buses.
    if on_serial.len() > lines::COUNT || !on_can.is_empty() {
        fault::halt();
    }

    let Some(uart) = Uart::new() else { fault::halt() };
    let mut actuators = Vec::new();
    let make = [lines::first, lines::second];
    for (&(number, bus), make) in on_serial.iter().zip(make) {
        let Some(line) = make(bus.bit_rate) else { fault::halt() };
        let _ = actuators.push(ActuatorLine { number, line });
    }
    let now_us = clock::now_us();
    if reset == Reset::Watchdog {
        // The loop had stopped, perhaps with torque on. The operator must look at the robot first.
        controller.estop(now_us);
    }
    let report =
        BoardReport { config_hash: controller.config().hash(), reset, ..BoardReport::default() };
    let board = Board {
        controller,
        actuators,
        usb: Link::new(Usb::new(settings.uid)),
        uart: Link::new(uart),
        host: Host::new(settings.node, HostPort::Usb),
        contact: EstopContact::new(),
        torque: Torque::Off,
        periods: Periods::start(now_us, settings.control_hz),
        watchdog: Watchdog::start(),
        report,
    };
    board.run()
}

/// Servo line of the robot at a port of the board.
struct ActuatorLine {
    /// Bus number of the line in the robot.
    number: u8,
    line: Line<Sender>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum HostPort {
    Usb,
    Uart,
}

/// Controller with its lines, ports and timers.
struct Board {
    controller: &'static mut Core,
    actuators: Vec<ActuatorLine, { lines::COUNT }>,
    usb: Link<Usb>,
    uart: Link<Uart>,
    host: Host<HostPort>,
    contact: EstopContact,
    /// Torque at the previous check.
    torque: Torque,
    periods: Periods,
    watchdog: Watchdog,
    report: BoardReport,
}

impl Board {
    fn run(mut self) -> ! {
        loop {
            self.take_in();
            let now_us = clock::now_us();
            if let Some(missed) = self.periods.next(now_us) {
                self.tick(now_us, missed);
            }
            self.give_out();
        }
    }

    /// Processes received bytes, a few of each line at a time, so that no line waits for another.
    fn take_in(&mut self) {
        let now_us = clock::now_us();
        if self.contact.take_opened() {
            self.controller.estop(now_us);
        }
        for ActuatorLine { number, line } in &mut self.actuators {
            while let Some(byte) = line.receive() {
                self.controller.on_serial(now_us, *number, &[byte]);
            }
        }
        self.usb.port.work();
        if let Some(packet) = self.usb.receive() {
            self.host.take(self.controller, now_us, HostPort::Usb, &packet);
        }
        if let Some(packet) = self.uart.receive() {
            self.host.take(self.controller, now_us, HostPort::Uart, &packet);
        }
        self.host.pass_on(self.controller, now_us);
    }

    /// Runs a control period, after `missed` control periods that were skipped.
    fn tick(&mut self, now_us: u64, missed: u64) {
        // While torque is off, a write of flash may cause missed periods.
        if self.torque != Torque::Off {
            self.report.missed_periods = self
                .report
                .missed_periods
                .saturating_add(u32::try_from(missed).unwrap_or(u32::MAX));
        }
        if self.contact.is_open() {
            self.controller.estop(now_us);
        }
        self.controller.tick(now_us);

        self.torque = self.controller.state().torque();
        let light = SIO.gpio_out(0);
        let switch = if self.torque == Torque::Off { light.value_clr() } else { light.value_set() };
        switch.write_value(1 << LIGHT);
        let took_us = clock::now_us().saturating_sub(now_us);
        self.report.longest_tick_us =
            self.report.longest_tick_us.max(u32::try_from(took_us).unwrap_or(u32::MAX));
        self.report.uptime_ms = (now_us / 1000) as u32;
        // Feeding is last, so that only a completed period prevents a reset of the chip.
        self.watchdog.feed();
    }

    /// Sends the next packet on every line that is free.
    fn give_out(&mut self) {
        let now_us = clock::now_us();
        for ActuatorLine { number, line } in &mut self.actuators {
            if line.is_free()
                && let Some(packet) = self.controller.poll_serial(*number)
            {
                line.send(packet);
            }
            line.work();
        }
        let usb = (HostPort::Usb, &mut self.usb);
        self.host.give(self.controller, now_us, usb, &self.report);
        let uart = (HostPort::Uart, &mut self.uart);
        self.host.give(self.controller, now_us, uart, &self.report);
        #[cfg(feature = "planted-panic")]
        {
            self.report.broken_words = u32::from(self.report.buses[usize::from(now_us as u8)].lost);
        }
    }
}
