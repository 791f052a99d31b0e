//! Controller on an emulated Cortex-M4F in real time, with its link over UART 0 as an SLCAN adapter, for `slcand` and
//! `rollwalk --bus slcan:`.
//!
//! The board keeps the time, and its loop is that of a real board. Only the servos are simulated ([`servos`]).
#![no_std]
#![no_main]

mod clock;
mod halt;
#[path = "../../image_keys.rs"]
mod image_keys;
mod line;
mod registers;
mod servos;
mod store;

// Module `robot` with configuration and buses.
include!(concat!(env!("OUT_DIR"), "/robot.rs"));

use cortex_m_rt::entry;
use rollwalk_firmware::bus::MAX_BUSES;
use rollwalk_firmware::hal::slcan::Adapter;
use rollwalk_firmware::{Controller, Settings};
use static_cell::StaticCell;

use clock::Clock;
use line::Line;
use servos::Servos;
use store::{Flash, Stores};

type Core = Controller<image_keys::Libraries<Flash<{ store::CAPACITY }>>>;

static CONTROLLER: StaticCell<Core> = StaticCell::new();

#[entry]
fn main() -> ! {
    let Some(peripherals) = cortex_m::Peripherals::take() else { halt::halt() };
    let Some(Stores { libraries, boots }) = store::mount() else { halt::halt() };
    let Some(store) = image_keys::require_signatures(libraries) else { halt::halt() };
    let settings = Settings::default();
    let Some(buses) = robot::buses() else { halt::halt() };
    let build = || Controller::with_buses(robot::config(), buses, store, settings);
    let Some(controller) = CONTROLLER.try_init_with(build) else { halt::halt() };
    let Some(()) = image_keys::require_key(controller, boots) else { halt::halt() };
    let Some(line) = Line::new() else { halt::halt() };
    let clock = Clock::start(peripherals.SYST, settings.control_hz);
    let adapter = Adapter::default();
    let mut board = Board { controller, servos: Servos::new(), line, adapter, clock };
    loop {
        let received = board.take_in();
        let moved = board.drive();
        board.give_out();
        if !received && !moved {
            board.rest();
        }
    }
}

/// Controller with its servos, line and clock.
struct Board {
    controller: &'static mut Core,
    servos: Servos,
    line: Line,
    adapter: Adapter,
    clock: Clock,
}

impl Board {
    /// Processes bytes from the host up to the next end of a line; returns true if a line ended.
    fn take_in(&mut self) -> bool {
        if self.line.has_lost() {
            self.adapter.lost();
        }
        while let Some(byte) = self.line.receive() {
            #[cfg(feature = "planted-panic")]
            let byte = [b'0'; 128][usize::from(byte)];
            let Some(request) = self.adapter.push(byte) else { continue };
            self.line.send(&request.answer);
            if let Some(frame) = request.frame {
                self.controller.on_link_frame(self.clock.now_us(), &frame);
            }
            return true;
        }
        false
    }

    /// Runs a control period that is due, and one frame with its answer on each actuator bus. Returns true if there was either.
    fn drive(&mut self) -> bool {
        let now_us = self.clock.now_us();
        let mut any = false;
        if self.clock.take_period() {
            self.controller.tick(now_us);
            any = true;
        }
        for bus in 0..MAX_BUSES as u8 {
            let Some(frame) = self.controller.poll_actuator(bus) else { continue };
            any = true;
            if let Some(answer) = self.servos.answer(bus, &frame) {
                self.controller.on_actuator_frame(now_us, bus, &answer);
            }
        }
        any
    }

    /// Sends frames to the host while there is room. Further frames wait in the controller, where newer ones replace them.
    fn give_out(&mut self) {
        self.line.work();
        while self.line.is_free()
            && let Some(frame) = self.controller.poll_link(self.clock.now_us())
        {
            if let Some(line) = self.adapter.line(&frame) {
                self.line.send(&line);
            }
        }
    }

    /// Sleeps until an interrupt. An interrupt between the check and the sleep is not lost: it stays pending and ends the
    /// sleep.
    fn rest(&mut self) {
        cortex_m::interrupt::free(|_| {
            if !self.line.is_busy() && !self.clock.is_due() {
                cortex_m::asm::wfi();
            }
        });
    }
}
