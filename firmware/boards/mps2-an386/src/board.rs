//! Controller on the emulated board: runs the requested steps, and counts their cost.

use crate::cost::Cost;
use crate::image_keys;
use crate::robot;
use crate::stack;
use crate::store::{self, Flash, Stores};
use cortex_m::Peripherals;
use rollwalk_firmware::{Controller, Settings};
use rollwalk_protocol::tunnel::{
    Answer, Figures, Hello, Input, MAX_ACTUATOR_BUSES, Request, Step, StepResult,
};
use rollwalk_protocol::wire::State;
use static_cell::StaticCell;

type Core = Controller<image_keys::Libraries<Flash<{ store::CAPACITY }>>>;

static CONTROLLER: StaticCell<Core> = StaticCell::new();

/// Controller and its cost.
pub struct Board {
    controller: &'static mut Core,
    cost: Cost,
    steps: u32,
    start_stack_bytes: u32,
}

impl Board {
    /// Creates the controller, and measures the stack that this takes. Returns `None` on a second call.
    pub fn start(peripherals: Peripherals) -> Option<Self> {
        let Stores { libraries, boots } = store::mount()?;
        let store = image_keys::require_signatures(libraries)?;
        let buses = robot::buses()?;
        let build = || Controller::with_buses(robot::config(), buses, store, Settings::default());
        let controller = CONTROLLER.try_init_with(build)?;
        image_keys::require_key(controller, boots)?;
        let start_stack_bytes = stack::deepest();
        stack::paint();
        let cost = Cost::new(peripherals.SYST);
        Some(Self { controller, cost, steps: 0, start_stack_bytes })
    }

    pub fn answer(&mut self, request: Request) -> Answer {
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

    fn step(&mut self, Step { now_us, input, free }: Step) -> StepResult {
        let Self { controller, cost, steps, .. } = self;
        *steps = steps.wrapping_add(1);
        match input {
            None => {}
            // The self test, which validates the stored library, is not part of a control period.
            Some(Input::Tick) if controller.state() == State::Boot => controller.tick(now_us),
            Some(Input::Tick) => cost.of_tick(|| controller.tick(now_us)),
            // While the robot is disarmed, a library is checked here. The check is not part of a control period.
            Some(Input::Link(frame)) if controller.state() == State::Disarmed => {
                controller.on_link_frame(now_us, &frame);
            }
            Some(Input::Link(frame)) => cost.of(|| controller.on_link_frame(now_us, &frame)),
            Some(Input::Actuator(bus, frame)) => {
                cost.of(|| controller.on_actuator_frame(now_us, bus, &frame));
            }
        }
        let mut stepped = StepResult::default();
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
        stepped
    }
}

/// Serves serial lines and buses with 29-bit identifiers like a board that has them, so that `cargo xtask sizes` includes their
/// code.
#[cfg(feature = "every-line")]
fn every_line(controller: &mut Core, now_us: u64, input: Option<Input>) {
    use core::hint::black_box;
    if let Some(Input::Actuator(bus, frame)) = input {
        controller.on_serial(now_us, bus, frame.data());
    }
    for bus in 0..MAX_ACTUATOR_BUSES {
        black_box(controller.poll_serial(bus));
    }
}
