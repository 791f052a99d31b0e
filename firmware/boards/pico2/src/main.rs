//! The controller on a Raspberry Pi Pico 2: two lines of serial servos; the link over USB or UART0.
//!
//! One loop, nothing blocks while torque is on. Interrupts only take bytes of the lines; everything else is asked in turn.
//! `firmware/boards/pico2/README.md` says how it is wired, flashed and tried.
#![no_std]
#![no_main]

mod chip;
mod clock;
mod estop;
mod fault;
mod flash;
#[path = "../../image_keys.rs"]
mod image_keys;
mod lines;
mod link;
mod uart;
mod usb;
mod watchdog;

// The module `robot`: configuration and buses.
include!(concat!(env!("OUT_DIR"), "/robot.rs"));

use cortex_m_rt::entry;
use embassy_rp::pac::SIO;
use heapless::Vec;
use rollwalk_firmware::hal::ports::{self, Transport};
use rollwalk_firmware::periods::Periods;
use rollwalk_firmware::store::{FlashParameters, FlashStore};
use rollwalk_firmware::{Controller, Settings};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{Gateway, Packet, Report, Reset};
use rollwalk_protocol::wire::{Node, ToController, Torque};
use static_cell::StaticCell;

use estop::Contact;
use flash::{Part, Parts};
use image_keys::Libraries;
use lines::Line;
use link::{Link, Port};
use uart::Uart;
use usb::Usb;
use watchdog::Watchdog;

/// Boots of a library on trial.
const TRIAL_BOOTS: u8 = 3;
/// The board's light, lit while torque is on.
const LIGHT: usize = 25;

/// The controller with its stores.
type Core = Controller<Libraries<Part>, FlashParameters<Part>>;

static CONTROLLER: StaticCell<Core> = StaticCell::new();

#[entry]
fn main() -> ! {
    let reset = chip::take_reset_cause();
    chip::start();
    chip::output::<LIGHT>();
    let settings = Settings { uid: chip::uid(), ..Settings::default() };
    let period_us = 1_000_000 / u32::from(settings.control_hz.max(1));
    // A period that was missed is one too many.
    let settings = Settings { overrun_us: period_us * 3 / 2, ..settings };
    let Parts { libraries, boots, parameters } = flash::parts();
    let Ok(libraries) = FlashStore::mount(libraries, TRIAL_BOOTS) else { fault::halt() };
    let Some(libraries) = image_keys::trusting(libraries) else { fault::halt() };
    let Ok(parameters) = FlashParameters::mount(parameters) else { fault::halt() };
    let (config, Some(buses)) = (robot::config(), robot::buses()) else { fault::halt() };
    // No image is made for a robot with others: `firmware/boards/bench/src/wiring.rs`.
    let [on_can, on_serial] =
        [Transport::Can, Transport::Serial].map(|kind| ports::assigned(&config, &buses, kind));
    if on_serial.len() > lines::COUNT || !on_can.is_empty() {
        fault::halt();
    }
    let build = || Controller::with_parameters(config, buses, libraries, parameters, settings);
    let Some(controller) = CONTROLLER.try_init_with(build) else { fault::halt() };
    let Some(()) = image_keys::insist(controller, boots) else { fault::halt() };

    let Some(uart) = Uart::new() else { fault::halt() };
    let mut actuators = Vec::new();
    let make: [fn(u32) -> Option<Line>; lines::COUNT] = [Line::first, Line::second];
    for (&(number, bus), make) in on_serial.iter().zip(make) {
        let Some(line) = make(bus.bit_rate) else { fault::halt() };
        let _ = actuators.push(ActuatorLine { number, line });
    }
    let now_us = clock::now_us();
    if reset == Reset::Watchdog {
        // The loop stopped, perhaps with torque on. The operator shall look before it goes on.
        controller.estop(now_us);
    }
    let report = Report { config_hash: controller.config().hash(), reset, ..Report::default() };
    let board = Board {
        controller,
        actuators,
        usb: Link::new(Usb::new(settings.uid)),
        uart: Link::new(uart),
        host: Host { node: settings.node, ..Host::default() },
        contact: Contact::new(),
        torque: Torque::Off,
        periods: Periods::start(now_us, settings.control_hz),
        watchdog: Watchdog::start(),
        report,
    };
    board.run()
}

/// A bus of the robot at a port of the board.
struct ActuatorLine {
    /// Its number in the robot.
    number: u8,
    line: Line,
}

/// The port over which the host's last message came: it is answered there.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum HostPort {
    #[default]
    Usb,
    Uart,
}

/// The host, as the controller's side of the link sees it.
#[derive(Default)]
struct Host {
    /// The controller's address on the link.
    node: u8,
    port: HostPort,
    /// Between the controller and the port.
    gateway: Gateway,
    /// The port that has asked for the report.
    report_due: Option<HostPort>,
}

impl Host {
    /// Takes a packet from a port.
    fn take(&mut self, controller: &mut Core, now_us: u64, port: HostPort, packet: &Packet<'_>) {
        match packet {
            Packet::Link(frame) => {
                if self.is_from_a_host(frame) {
                    self.turn_to(port);
                }
                controller.on_link_frame(now_us, frame);
            }
            Packet::Message { id, bytes } => {
                // Its identifier names sender and receiver.
                if Frame::standard(*id, &[]).is_some_and(|frame| self.is_from_a_host(&frame)) {
                    self.turn_to(port);
                    self.gateway.receive(*id, bytes);
                }
            }
            Packet::Ask => self.report_due = Some(port),
            Packet::Report(_) => {}
        }
    }

    /// Whether a frame is a host's and for this controller.
    fn is_from_a_host(&self, frame: &Frame) -> bool {
        ToController::decode(frame)
            .is_ok_and(|(to, _)| to.number() == self.node || to == Node::BROADCAST)
    }

    /// Answers the host at this port from now on. A message under way to the other port is dropped.
    fn turn_to(&mut self, port: HostPort) {
        if self.port != port {
            (self.port, self.gateway) = (port, Gateway::default());
        }
    }

    /// Gives a port that is free the next packet.
    fn give(
        &mut self,
        controller: &mut Core,
        now_us: u64,
        (port, link): (HostPort, &mut Link<impl Port>),
        report: &Report,
    ) {
        if link.is_free() && self.report_due == Some(port) {
            self.report_due = None;
            link.send(&Packet::Report(*report));
        }
        if link.is_free()
            && self.port == port
            && let Some(frame) = controller.poll_link(now_us)
            && let Some(packet) = self.gateway.send(now_us, &frame)
        {
            link.send(&packet);
        }
        link.work();
    }
}

/// The controller and everything around it.
struct Board {
    controller: &'static mut Core,
    actuators: Vec<ActuatorLine, { lines::COUNT }>,
    usb: Link<Usb>,
    uart: Link<Uart>,
    host: Host,
    contact: Contact,
    /// Torque at the last check.
    torque: Torque,
    periods: Periods,
    watchdog: Watchdog,
    report: Report,
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

    /// What arrived: some bytes of each line at a time, so that none waits for another.
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
        if let Some(frame) = self.host.gateway.poll(now_us) {
            self.controller.on_link_frame(now_us, &frame);
        }
    }

    /// Runs a control period, after `missed` ones that went by unnoticed.
    fn tick(&mut self, now_us: u64, missed: u64) {
        // While torque is off, flash may be written, and periods are missed for it.
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
        // Last: only a period that came to its end keeps the chip from being reset.
        self.watchdog.feed();
    }

    /// To every line that can take a packet, the next one.
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
