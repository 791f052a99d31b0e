//! The controller on an emulated Cortex-M4F, its buses and its time tunnelled over UART 0.
//!
//! Answers one packet with one packet ([`rollwalk_protocol::tunnel`]) and does nothing by itself.
#![no_std]
#![no_main]

mod cost;
mod halt;
mod registers;
mod robot;
mod stack;
mod store;
mod uart;

use cortex_m_rt::entry;
use rollwalk_firmware::{Controller, Settings};
use rollwalk_protocol::tunnel::{
    Answer, Deframer, Figures, Hello, Input, MAX_ACTUATOR_BUSES, Request, Step, Stepped,
};
use rollwalk_protocol::wire::State;
use static_cell::StaticCell;

use cost::Cost;
use store::BoardStore;
use uart::Uart;

static CONTROLLER: StaticCell<Controller<BoardStore>> = StaticCell::new();

#[entry]
fn main() -> ! {
    stack::paint();
    let Some(peripherals) = cortex_m::Peripherals::take() else { halt::halt() };
    let Some(config) = robot::config() else { halt::halt() };
    let Some(store) = store::mount() else { halt::halt() };
    let build = || Controller::new(config, store, Settings::default());
    let Some(controller) = CONTROLLER.try_init_with(build) else { halt::halt() };
    let mut uart = Uart::new();
    let start_stack_bytes = stack::deepest();
    stack::paint();
    let cost = Cost::new(peripherals.SYST);
    let mut board = Board { controller, cost, steps: 0, start_stack_bytes };
    let mut deframer = Deframer::default();
    loop {
        let Some(packet) = deframer.push(uart.read()) else { continue };
        // What is no question of ours gets no answer: the host asks again or gives up.
        let Some((sequence, request)) = Request::decode(packet) else { continue };
        if let Some(line) = board.answer(request).encode(sequence) {
            line.iter().for_each(|&byte| uart.write(byte));
        }
    }
}

/// The controller and what it costs.
struct Board {
    controller: &'static mut Controller<BoardStore>,
    cost: Cost,
    steps: u32,
    start_stack_bytes: u32,
}

impl Board {
    fn answer(&mut self, request: Request) -> Answer {
        match request {
            Request::Hello => Answer::Hello(Hello {
                config_hash: self.controller.config().hash(),
                steps: self.steps,
            }),
            Request::Step(step) => Answer::Stepped(self.step(step)),
            Request::Figures => {
                let (start_stack_bytes, stack_bytes) = (self.start_stack_bytes, stack::deepest());
                let figures = self.cost.figures();
                Answer::Figures(Figures { start_stack_bytes, stack_bytes, ..figures })
            }
        }
    }

    fn step(&mut self, Step { now_us, input, free }: Step) -> Stepped {
        let Self { controller, cost, steps, .. } = self;
        *steps = steps.wrapping_add(1);
        match input {
            None => {}
            // The self test of the first one is no part of a control period either.
            Some(Input::Tick) if controller.state() == State::Boot => controller.tick(now_us),
            Some(Input::Tick) => cost.of_tick(|| controller.tick(now_us)),
            // While it is disarmed a library is checked in here: no part of a control period.
            Some(Input::Link(frame)) if controller.state() == State::Disarmed => {
                controller.on_link_frame(now_us, &frame);
            }
            Some(Input::Link(frame)) => cost.of(|| controller.on_link_frame(now_us, &frame)),
            Some(Input::Actuator(bus, frame)) => {
                cost.of(|| controller.on_actuator_frame(now_us, bus, &frame));
            }
        }
        let mut stepped = Stepped::default();
        if free.link() {
            stepped.link = cost.of(|| controller.poll_link(now_us));
        }
        for (bus, slot) in (0..MAX_ACTUATOR_BUSES).zip(&mut stepped.actuators) {
            if free.actuator(bus) {
                *slot = cost.of(|| controller.poll_actuator(bus));
            }
        }
        stepped.playing = controller.playing().map(|p| (p.clip.0, p.frame, p.phase));
        #[cfg(feature = "every-line")]
        every_line(controller, now_us, input);
        #[cfg(feature = "planted-panic")]
        {
            stepped.link = stepped.actuators[usize::from(now_us as u8)];
        }
        stepped
    }
}

/// Serial lines and buses with 29-bit identifiers, as a board that has them would serve them: this one has
/// none, but what they take is to be counted (`cargo xtask sizes`).
#[cfg(feature = "every-line")]
fn every_line(controller: &mut Controller<BoardStore>, now_us: u64, input: Option<Input>) {
    use core::hint::black_box;
    use rollwalk_protocol::can::ExtendedFrame;
    if let Some(Input::Actuator(bus, frame)) = input {
        controller.on_serial(now_us, bus, frame.data());
        if let Some(frame) = ExtendedFrame::new(frame.id().into(), frame.data()) {
            controller.on_extended_frame(now_us, bus, &frame);
        }
    }
    for bus in 0..MAX_ACTUATOR_BUSES {
        black_box(controller.poll_serial(bus));
        black_box(controller.poll_extended(bus));
    }
}
