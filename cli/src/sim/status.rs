//! Messages of `rollwalk-sim` about the state of the controller.

use rollwalk_host::actuators::Actuators;
use rollwalk_host::describe::condition;
use rollwalk_protocol::faults::FaultBits;
use rollwalk_protocol::wire::{State, Status};
use rollwalk_robot::Robot;
use rollwalk_terminal::output;
use rollwalk_terminal::validated_library::actuators;

/// Prints changes of the controller's state and faults to stderr.
pub struct StatusPrinter {
    last: Option<(State, FaultBits)>,
    actuators: Actuators,
}

impl StatusPrinter {
    pub fn new(robot: &Robot) -> Self {
        Self { last: None, actuators: actuators(robot) }
    }

    /// Prints a status if it has changed. `at_s` is the time of the simulated robot, which may lag behind real time; for a
    /// controller alone it is real time.
    pub fn print(&mut self, at_s: f64, state: State, faults: FaultBits) {
        if self.last.replace((state, faults)) == Some((state, faults)) {
            return;
        }
        let severity = state.severity(faults);
        let status =
            Status { state, severity, faults, clip: None, frame: 0, counter: 0, library: 0 };
        output::print_line(format_args!("{at_s:9.3} s  {}", condition(&status, &self.actuators)));
    }
}
