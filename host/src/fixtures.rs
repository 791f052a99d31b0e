//! Robots and statuses that several tests of this crate use.

use crate::actuators::{ActuatorBus, Actuators, BusKind, ChannelActuator};
use rollwalk_protocol::faults::FaultBits;
use rollwalk_protocol::wire::{State, Status};

/// Dynamixel XL330 servos with the given IDs on one serial line.
pub fn servo_line(ids: impl IntoIterator<Item = u8>) -> Actuators {
    let bus =
        ActuatorBus { kind: BusKind::ServoLine, protocol: "Dynamixel".into(), bit_rate: 1_000_000 };
    let servo = |id| ChannelActuator { bus: 0, id, model: "XL330-M288-T".into() };
    Actuators { buses: vec![bus], channels: ids.into_iter().map(servo).collect() }
}

/// Status of a controller that plays no clip.
pub fn status(state: State, faults: FaultBits) -> Status {
    let severity = state.severity(faults);
    Status { state, severity, faults, clip: None, frame: 0, counter: 0, library: 0 }
}
