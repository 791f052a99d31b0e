//! The controller on an emulated Cortex-M4F in real time, its link over UART 0 as an SLCAN adapter has it: for
//! `slcand`, and `rollwalk --bus slcan:`.
//!
//! The board keeps the time, and the loop is that of a real one. Only the servos are simulated, in here
//! ([`servos`]).
#![no_std]
#![no_main]

mod clock;
mod halt;
mod line;
mod registers;
mod robot;
mod servos;
mod store;

use cortex_m_rt::entry;
use rollwalk_firmware::bus::MAX_BUSES;
use rollwalk_firmware::hal::slcan::Adapter;
use rollwalk_firmware::{Controller, Settings};
use static_cell::StaticCell;

use clock::Clock;
use line::Line;
use servos::Servos;
use store::BoardStore;

static CONTROLLER: StaticCell<Controller<BoardStore>> = StaticCell::new();

#[entry]
fn main() -> ! {
    let Some(peripherals) = cortex_m::Peripherals::take() else { halt::halt() };
    let Some(config) = robot::config() else { halt::halt() };
    let Some(store) = store::mount() else { halt::halt() };
    let settings = Settings::default();
    let build = || Controller::new(config, store, settings);
    let Some(controller) = CONTROLLER.try_init_with(build) else { halt::halt() };
    let Some(line) = Line::new() else { halt::halt() };
    let clock = Clock::start(peripherals.SYST, settings.control_hz);
    let adapter = Adapter::default();
    let mut board = Board { controller, servos: Servos::new(), line, adapter, clock };
    loop {
        let heard = board.take_in();
        let moved = board.drive();
        board.give_out();
        if !heard && !moved {
            board.rest();
        }
    }
}

/// The controller and everything around it.
struct Board {
    controller: &'static mut Controller<BoardStore>,
    servos: Servos,
    line: Line,
    adapter: Adapter,
    clock: Clock,
}

impl Board {
    /// What the host says, up to the next end of a line; whether there was any.
    fn take_in(&mut self) -> bool {
        if self.line.has_lost() {
            self.adapter.lost();
        }
        while let Some(byte) = self.line.receive() {
            let Some(heard) = self.adapter.push(byte) else { continue };
            self.line.send(&heard.answer);
            if let Some(frame) = heard.frame {
                self.controller.on_link_frame(self.clock.now_us(), &frame);
            }
            return true;
        }
        false
    }

    /// The control period, and a frame for a servo on each bus with its answer; whether there was any.
    fn drive(&mut self) -> bool {
        let now_us = self.clock.now_us();
        let mut any = false;
        #[cfg(feature = "planted-panic")]
        {
            static WHETHER: [bool; 2] = [false, true];
            any |= WHETHER[usize::from(now_us as u8)];
        }
        if self.clock.begun() {
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

    /// To the host, as long as there is room: what waits for it waits in the controller, where it is replaced
    /// by what is newer.
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

    /// Until an interrupt. None is lost between the question and the sleep: one that is pending ends it.
    fn rest(&mut self) {
        cortex_m::interrupt::free(|_| {
            if !self.line.is_busy() && !self.clock.is_due() {
                cortex_m::asm::wfi();
            }
        });
    }
}
