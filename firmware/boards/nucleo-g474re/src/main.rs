//! Controller on a NUCLEO-G474RE. FDCAN1 is the link; FDCAN2, FDCAN3 and USART3 are the actuator buses. The debugger's serial
//! port is a second port of the link.
//!
//! A single loop polls everything in turn, and nothing blocks while torque is on. Interrupts only receive bytes of the serial
//! lines, and record that the emergency-stop contact opened. Wiring, flashing and testing:
//! `firmware/boards/nucleo-g474re/README.md`.
#![no_std]
#![no_main]

mod can;
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
#[path = "../../link.rs"]
mod link;
#[path = "../../partition.rs"]
mod partition;
#[path = "../../received.rs"]
mod received;
mod serial;
#[path = "../../start.rs"]
mod start;
mod usart;
mod watchdog;

// Module `robot` with configuration and buses.
include!(concat!(env!("OUT_DIR"), "/robot.rs"));

use cortex_m_rt::entry;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::{Peripherals, peripherals};
use heapless::Vec;
use rollwalk_firmware::periods::Periods;
use rollwalk_protocol::serial::{BoardReport, BusState, Reset};
use rollwalk_protocol::wire::{State, Torque};

use can::Bus;
use clock::Clock;
use estop::EstopContact;
use host::Host;
use line::Line;
use link::Link;
use serial::Serial;
use start::{Core, ReadyController};
use usart::Sender;
use watchdog::Watchdog;

/// Number of CAN ports for actuators.
const ACTUATOR_PORTS: usize = can::PORTS.len() - 1;
const LINK_BIT_RATE: u32 = 1_000_000;
/// Timeout of a link frame that waits for the bus, µs. After an interruption, an older frame is useless.
const LINK_PATIENCE_US: u64 = 50_000;

/// Disconnects from the buses.
fn silence() {
    can::silence();
    usart::silence();
}

#[entry]
fn main() -> ! {
    // SAFETY: only this line takes the peripherals, and it runs once. The HAL's own `init` would contain a panic for a second
    // call.
    let mut p = unsafe { Peripherals::steal() };
    chip::start(&mut p);
    let mut clock = Clock::start();
    let (settings, period_us) = start::settings(chip::uid());
    let Some(parts) = flash::parts() else { fault::halt() };
    let started = start::start(parts, settings);
    let Some(ReadyController { controller, on_can, on_serial }) = started else { fault::halt() };
    // `apps/board-bench/src/wiring.rs` makes no image for a robot with other buses.
    if on_can.len() > ACTUATOR_PORTS || on_serial.len() > 1 {
        fault::halt();
    }

    let Some(serial) = Serial::new(p.PA3, p.PA2) else { fault::halt() };
    can::connect::<peripherals::FDCAN1>(p.PA11, p.PA12);
    can::connect::<peripherals::FDCAN2>(p.PB12, p.PB13);
    can::connect::<peripherals::FDCAN3>(p.PA8, p.PA15);
    let [link, others @ ..] = can::PORTS;
    let Some(link) = Bus::new(link, LINK_BIT_RATE) else { fault::halt() };
    let mut actuators = Vec::new();
    for (&(number, kind), port) in on_can.iter().zip(others) {
        let Some(bus) = Bus::new(port, kind.bit_rate) else { fault::halt() };
        let _ = actuators.push(ActuatorBus { number, bus });
    }
    let line = match on_serial.first() {
        None => None,
        Some((number, kind)) => match usart::start(p.PB10, kind.bit_rate) {
            Some(line) => Some((*number, line)),
            None => fault::halt(),
        },
    };
    let reset = chip::take_reset_cause();
    let now_us = clock.now_us();
    if reset == Reset::Watchdog {
        // The loop had stopped, perhaps with torque on. The operator must look at the robot first.
        controller.estop(now_us);
    }
    let report = BoardReport {
        config_hash: controller.config().hash(),
        reset,
        brown_out_level: chip::brown_out_level(),
        ..BoardReport::default()
    };
    let board = Board {
        controller,
        link,
        actuators,
        line,
        serial: Link::new(serial),
        host: Host::new(settings.node, HostPort::Can),
        contact: EstopContact::new(p.PA10),
        light: Output::new(p.PA5, Level::Low, Speed::Low),
        torque: Torque::Off,
        periods: Periods::start(now_us, settings.control_hz),
        period_us: period_us.into(),
        watchdog: Watchdog::start(),
        report,
        stopped_for_link: false,
        clock,
    };
    board.run()
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum HostPort {
    Can,
    Serial,
}

/// Bus of the robot at a port of the board.
struct ActuatorBus {
    /// Number of the bus in the robot.
    number: u8,
    bus: Bus,
}

/// Controller with its buses, ports and timers.
struct Board {
    controller: &'static mut Core,
    link: Bus,
    actuators: Vec<ActuatorBus, ACTUATOR_PORTS>,
    /// Servo line, with its bus number in the robot.
    line: Option<(u8, Line<Sender>)>,
    serial: Link<Serial>,
    host: Host<HostPort>,
    contact: EstopContact,
    light: Output<'static>,
    /// Torque at the previous check.
    torque: Torque,
    periods: Periods,
    period_us: u64,
    watchdog: Watchdog,
    report: BoardReport,
    /// True if the emergency stop for a link in bus-off was raised.
    stopped_for_link: bool,
    clock: Clock,
}

impl Board {
    fn run(mut self) -> ! {
        loop {
            self.take_in();
            self.watch_torque();
            let now_us = self.clock.now_us();
            if let Some(missed) = self.periods.next(now_us) {
                self.tick(now_us, missed);
                self.watch_torque();
            }
            self.give_out();
        }
    }

    /// Processes received data, one frame of each bus at a time, so that no bus waits for another.
    fn take_in(&mut self) {
        let now_us = self.clock.now_us();
        if self.contact.take_opened() {
            self.controller.estop(now_us);
        }
        for ActuatorBus { number, bus } in &mut self.actuators {
            if let Some(frame) = bus.receive() {
                self.controller.on_actuator_frame(now_us, *number, &frame);
            }
        }
        if let Some((number, line)) = &mut self.line {
            while let Some(byte) = line.receive() {
                self.controller.on_serial(now_us, *number, &[byte]);
            }
        }
        if let Some(frame) = self.link.receive() {
            self.host.take_frame(self.controller, now_us, HostPort::Can, &frame);
        }
        if let Some(packet) = self.serial.receive() {
            self.host.take(self.controller, now_us, HostPort::Serial, &packet);
        }
        self.host.pass_on(self.controller, now_us);
    }

    /// Cancels frames that wait on the actuator buses when torque has just been switched off, because they were queued before.
    fn watch_torque(&mut self) {
        let torque = self.controller.state().torque();
        if torque == Torque::Off && self.torque != Torque::Off {
            self.actuators.iter_mut().for_each(|actuator| actuator.bus.cancel());
        }
        self.torque = torque;
    }

    /// Runs a control period, after `missed` control periods that were skipped.
    fn tick(&mut self, now_us: u64, missed: u64) {
        self.report.missed_periods =
            self.report.missed_periods.saturating_add(u32::try_from(missed).unwrap_or(u32::MAX));
        let broken =
            flash::broken_words() != self.report.broken_words && self.torque != Torque::Off;
        self.report.broken_words = flash::broken_words();
        flash::forget_corrected();
        if broken || self.contact.is_open() || chip::supply_is_low() {
            self.controller.estop(now_us);
        }
        self.watch_actuator_buses(now_us);
        self.watch_link(now_us);
        self.controller.tick(now_us);

        self.light.set_level(Level::from(self.torque != Torque::Off));
        let took_us = self.clock.now_us().saturating_sub(now_us);
        self.report.longest_tick_us =
            self.report.longest_tick_us.max(u32::try_from(took_us).unwrap_or(u32::MAX));
        self.report.uptime_ms = (now_us / 1000) as u32;
        // Feeding is last, so that only a completed period prevents a reset of the chip.
        self.watchdog.feed();
    }

    /// Checks the actuator buses. A bus in bus-off stays off until an operator has cleared the stop.
    fn watch_actuator_buses(&mut self, now_us: u64) {
        let [_, slots @ ..] = &mut self.report.buses;
        for (ActuatorBus { number, bus }, slot) in self.actuators.iter_mut().zip(slots) {
            bus.expire(now_us, self.period_us);
            *slot = bus.report();
            self.controller.on_bus_state(now_us, *number, slot.state);
            if self.controller.take_bus_restart(*number) {
                bus.start();
            }
        }
    }

    /// Checks the link for bus-off.
    ///
    /// With torque on, bus-off counts as a lost host: the robot goes to SAFE. With torque off it raises an emergency stop, so
    /// that the link also waits for an operator.
    fn watch_link(&mut self, now_us: u64) {
        self.link.expire(now_us, LINK_PATIENCE_US);
        let [slot, ..] = &mut self.report.buses;
        *slot = self.link.report();
        if slot.state != BusState::Off {
            return;
        }
        // The only way from EStopped to Disarmed is a clear by an operator.
        if self.stopped_for_link && self.controller.state() == State::Disarmed {
            self.stopped_for_link = false;
            self.link.start();
        } else if !self.stopped_for_link && self.torque == Torque::Off {
            self.stopped_for_link = true;
            self.controller.estop(now_us);
        }
    }

    /// Sends the next frame on every bus that is free.
    fn give_out(&mut self) {
        let now_us = self.clock.now_us();
        for ActuatorBus { number, bus } in &mut self.actuators {
            if bus.is_free()
                && let Some(frame) = self.controller.poll_actuator(*number)
            {
                bus.send(now_us, &frame);
            }
        }
        if let Some((number, line)) = &mut self.line {
            if line.is_free()
                && let Some(packet) = self.controller.poll_serial(*number)
            {
                line.send(packet);
            }
            line.work();
        }
        if self.link.is_free()
            && let Some(frame) = self.host.poll(self.controller, now_us, HostPort::Can)
        {
            self.link.send(now_us, &frame);
        }
        let serial = (HostPort::Serial, &mut self.serial);
        self.host.give(self.controller, now_us, serial, &self.report);
        #[cfg(feature = "planted-panic")]
        {
            self.report.broken_words = u32::from(self.report.buses[usize::from(now_us as u8)].lost);
        }
    }
}
