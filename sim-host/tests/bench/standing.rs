//! Robot that is switched on without a host.

use crate::robot;
use rollwalk_protocol::actuator::{Control, Feedback, JointSetpoint, WheelSetpoint};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::interface::{Interface, LogEntry};
use rollwalk_sim_host::rig::Rig;

#[test]
fn is_asked_for_its_pose_and_gets_no_setpoint() {
    let mut rig = Rig::new(&robot::robot()).unwrap();
    rig.run_until(SimTime::from_ms(500));
    // On the link, identifiers have another meaning.
    let on_actuators = |entry: &&LogEntry| matches!(entry.interface, Interface::Actuator(_));
    let frames = || rig.log().iter().filter(on_actuators).map(|entry| &entry.frame);
    assert!(frames().any(|frame| Control::decode(frame).is_some()));
    for bus in [0, 1] {
        let on_bus = |entry: &&LogEntry| entry.interface == Interface::Actuator(bus);
        let mut frames = rig.log().iter().filter(on_bus).map(|e| &e.frame);
        assert!(frames.any(|frame| Feedback::decode(frame).is_some()));
    }
    let setpoint =
        |frame| JointSetpoint::decode(frame).is_some() || WheelSetpoint::decode(frame).is_some();
    assert!(!frames().any(setpoint));
    assert!(rig.records().is_empty());
}

#[test]
fn sinks_until_its_leg_hangs() {
    let mut rig = Rig::new(&robot::robot()).unwrap();
    let start = rig.body().values();
    rig.run_until(SimTime::from_ms(60_000));
    let end = rig.body().values();
    // After a minute, friction and weight have acted. Thigh and shank hang down: with all joints at 0, the leg is straight
    // below the hip.
    assert!(start[0].abs() > 0.2 && start[1].abs() > 0.5);
    assert!(end[0].abs() < 0.01 && end[1].abs() < 0.01, "{end:?}");
}
