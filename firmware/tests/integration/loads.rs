//! Overloaded buses and set-points that an actuator's protocol cannot carry are refused.

use rollwalk_firmware::bus::{Bus, Buses, ControlLoop, MAX_BUSES, Protocol};
use rollwalk_firmware::load::{BusLoad, BusProblem, examine};
use rollwalk_firmware::{Controller, Settings};
use rollwalk_protocol::actuators::Refusal;
use rollwalk_protocol::actuators::mit::{AnswerId, MODELS, Mit};
use rollwalk_protocol::actuators::odrive::Version;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::wire::State;

use crate::protocols::{cybergear, dynamixel, maestro, mit, odrive};
use crate::rig::Rig;
use crate::{flash, robot};

/// Robot with `count` joints on bus 0.
fn joints(count: u8) -> RobotConfig {
    let joint = robot::config().channels[0];
    let channel = |id| rollwalk_protocol::config::Channel { id, ..joint };
    RobotConfig { channels: (1..=count).map(channel).collect(), ..robot::config() }
}

fn on(protocol: Protocol) -> Bus {
    Bus { protocol, ..Bus::default() }
}

fn only(config: &RobotConfig, bus: Bus, control_hz: u16) -> BusLoad {
    let rows: Vec<BusLoad> = examine(config, &[bus].into_iter().collect(), control_hz).collect();
    assert_eq!(rows.len(), 1);
    rows[0]
}

#[test]
fn what_does_not_fit_is_refused_and_what_fits_is_not() {
    // 270 bits for each actuator and period: 10 use 32.4 % at 120 Hz, 21 use 68 %, 22 use 71 %.
    let row = only(&joints(10), Bus::default(), 120);
    assert_eq!((row.bus, row.actuators, row.problem), (0, 10, None));
    assert!((row.load - 0.324).abs() < 1e-6);
    assert_eq!(only(&joints(21), Bus::default(), 120).problem, None);
    let Some(BusProblem::Overload(beyond)) = only(&joints(22), Bus::default(), 120).problem else {
        panic!("22 actuators on a bus")
    };
    assert!((beyond.percent - 71.28).abs() < 0.01);
    let half = Bus { bit_rate: 500_000, ..Bus::default() };
    assert!(matches!(only(&joints(11), half, 120).problem, Some(BusProblem::Overload(_))));
    let none = Bus { bit_rate: 0, ..Bus::default() };
    assert!(matches!(only(&joints(1), none, 120).problem, Some(BusProblem::Overload(_))));
}

#[test]
fn every_protocol_fits_on_a_bus_of_its_own() {
    for protocol in [
        mit(6, AnswerId::Master(0)),
        odrive(Version::V05),
        odrive(Version::V06),
        cybergear(),
        maestro(),
    ] {
        assert_eq!(only(&joints(4), on(protocol), 120).problem, None, "{protocol:?}");
    }
    // The return delay is 500 µs by default.
    let Protocol::Dynamixel(prompt) = dynamixel() else { unreachable!() };
    let mut calm = joints(4);
    calm.channels.iter_mut().for_each(|c| c.max_rate = 5.0);
    let line = Bus { bit_rate: 3_000_000, ..on(dynamixel()) };
    assert_eq!(only(&calm, line, 120).problem, None);
    let late = Protocol::Dynamixel(rollwalk_protocol::actuators::dynamixel::Dynamixel {
        return_delay_us: 1500,
        ..prompt
    });
    let line = Bus { bit_rate: 3_000_000, ..on(late) };
    assert!(matches!(only(&calm, line, 120).problem, Some(BusProblem::Overload(_))));
}

#[test]
fn what_cannot_be_told_is_found_before_it_has_to_be() {
    let cannot = |config: &RobotConfig, bus| match only(config, bus, 120).problem {
        Some(BusProblem::CannotCarry { channel, refusal }) => (channel, refusal),
        other => panic!("{other:?}"),
    };
    // AK80-64: at most 8 rad/s. Gains of an MIT frame end at 500 and 5.
    let mut config = joints(2);
    config.channels[1].max_rate = 8.5;
    let slow = Mit { model: MODELS[5], answers_from: AnswerId::Own };
    assert_eq!(cannot(&config, on(Protocol::Mit(slow))), (1, Refusal::OutOfRange("speed")));
    config.channels[0].kd_nm_s_rad = 5.5;
    assert_eq!(cannot(&config, on(mit(4, AnswerId::Own))), (0, Refusal::OutOfRange("kd")));
    // An ODrive's kp is a multiple of its kd.
    config.channels[0].kd_nm_s_rad = 0.0;
    assert_eq!(cannot(&config, on(odrive(Version::V06))), (0, Refusal::OutOfRange("kd")));
    // 63 nodes at most.
    let mut config = joints(1);
    config.channels[0].id = 64;
    assert_eq!(cannot(&config, on(odrive(Version::V06))), (0, Refusal::Address));
    // Range beyond the pulses of a servo, and a wheel.
    let mut config = joints(1);
    (config.channels[0].min, config.channels[0].max) = (-2.0, 2.0);
    assert_eq!(cannot(&config, on(maestro())), (0, Refusal::OutOfRange("position")));
    let mut config = robot::config();
    config.channels.retain(|c| c.bus == 1);
    config.channels[0].bus = 0;
    assert_eq!(cannot(&config, on(maestro())), (0, Refusal::Unsupported("wheel speed")));
    // A torque needs a drive that accepts it, and must be within the drive's scale.
    let torque = |protocol| Bus { control: ControlLoop::OnController, ..on(protocol) };
    assert_eq!(cannot(&joints(1), torque(Protocol::Rollwalk)), (0, Refusal::Unsupported("torque")));
    let mut config = joints(1);
    config.channels[0].max_torque_nm = 13.0;
    assert_eq!(cannot(&config, torque(cybergear())), (0, Refusal::OutOfRange("torque")));
}

#[test]
fn poses_that_come_too_seldom_are_refused() {
    let row = only(&joints(1), on(odrive(Version::V06)), 480);
    assert_eq!(row.problem, Some(BusProblem::TooSeldom { needed_hz: 240 }));
    assert_eq!(only(&joints(1), on(odrive(Version::V06)), 240).problem, None);
}

#[test]
fn a_bus_that_a_controller_does_not_have_is_refused() {
    let mut config = joints(2);
    config.channels[1].bus = MAX_BUSES as u8;
    let rows: Vec<_> = examine(&config, &Buses::new(), 120).map(|r| (r.bus, r.problem)).collect();
    assert_eq!(rows, [(0, None), (MAX_BUSES as u8, Some(BusProblem::NoSuchBus))]);
}

/// Self test of the controller finds the overload, and arming is refused.
#[test]
fn the_self_test_fails() {
    let mut rig = Rig::new(None);
    let config = robot::config();
    // 540 bits 120 times a second.
    let slow = Bus { bit_rate: 90_000, ..on(mit(4, AnswerId::Own)) };
    let buses = [slow, slow].into_iter().collect();
    let store = flash::store(Some(&robot::library()));
    let parameters = flash::parameters();
    rig.brain = Controller::with_parameters(config, buses, store, parameters, Settings::default());
    rig.buses_up = false;
    rig.run(5);
    assert_eq!(rig.brain.state(), State::TorqueOff);
    assert!(rig.brain.faults().contains(rollwalk_protocol::faults::Fault::Internal));
}
