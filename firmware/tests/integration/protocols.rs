//! Controller with drives of every protocol: arm, align, play, stop.

use crate::drives::Drive;
use crate::flash;
use crate::rig::Rig;
use crate::robot::{self, CODE_DRIVE, CODE_WALK, STAND};
use rollwalk_drives::{DriveCommand, Kind};
use rollwalk_firmware::bus::{Bus, Buses, Pose, Protocol};
use rollwalk_firmware::{Controller, Settings};
use rollwalk_protocol::actuators::cybergear::{CyberGear, TABLE_MAX_RAD};
use rollwalk_protocol::actuators::dynamixel::{Dynamixel, table};
use rollwalk_protocol::actuators::feetech::Feetech;
use rollwalk_protocol::actuators::maestro::{Maestro, Pulse};
use rollwalk_protocol::actuators::mit::{AnswerId, MODELS, Mit};
use rollwalk_protocol::actuators::odrive::{Odrive, Version};
use rollwalk_protocol::actuators::{Codec, UpdatePolicy};
use rollwalk_protocol::config::{ChannelKind, RobotConfig};
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::{
    Action, ActuatorReadings, CommandResult, FromController, Parameter, ParameterAction,
    ParameterResult, State,
};

pub fn mit(model: usize, answers_from: AnswerId) -> Protocol {
    Protocol::Mit(Mit { model: MODELS[model], answers_from })
}

pub fn odrive(version: Version) -> Protocol {
    let reduction = -9.0;
    Protocol::Odrive(Odrive { version, reduction, torque_constant_nm_a: 0.05, estimates_hz: 120 })
}

pub fn cybergear() -> Protocol {
    Protocol::CyberGear(CyberGear { host: 0xFD, max_position_rad: TABLE_MAX_RAD })
}

pub fn dynamixel() -> Protocol {
    let model = table::XM540_W150;
    Protocol::Dynamixel(Dynamixel {
        model,
        watchdog_20ms: 5,
        return_delay_us: 0,
        reads_fast: false,
    })
}

pub fn feetech() -> Protocol {
    Protocol::Feetech(Feetech::EXAMPLES[0])
}

pub fn maestro() -> Protocol {
    let pulse = Pulse { limits_us: (500.0, 2500.0), ..Pulse::default() };
    Protocol::Maestro(Maestro { device: None, crc: false, set_multiple: true, pulse })
}

/// Protocols that drive joints and wheels, except the Rollwalk profile.
fn protocols() -> impl Iterator<Item = Protocol> {
    Protocol::examples().skip(1).filter(|protocol| protocol.capabilities().wheels)
}

/// Robot with `protocol` on both buses.
fn bench(protocol: Protocol) -> Rig {
    let mut config = robot::config();
    let bus = Bus { protocol, ..Bus::default() };
    if config.channels.iter().any(|channel| bus.can_drive(channel).is_err()) {
        slow_down(&mut config);
    }
    if matches!(protocol, Protocol::Feetech(_)) {
        // The stall torque of an STS3215 at 12 V is 2.94 N·m.
        config.channels.iter_mut().for_each(|c| c.max_torque_nm = c.max_torque_nm.min(2.9));
    }
    bench_of(config, [protocol; 2], Bus::default())
}

/// Limits the channels to the speeds of an XM540-W150, 230 steps of 0.229 rev/min, and of an STS3215 at 12 V, 45 rev/min.
pub fn slow_down(config: &mut RobotConfig) {
    config.channels.iter_mut().for_each(|c| c.max_rate = c.max_rate.min(4.7));
    (config.channels[2].min, config.channels[2].max) = (-4.7, 4.7);
    config.channels[2].max_rate = 60.0;
}

pub fn bench_of(config: RobotConfig, protocols: [Protocol; 2], like: Bus) -> Rig {
    let library = robot::library_for(&robot::config());
    let library = if config == robot::config() { library } else { robot::calm_library(&config) };
    bench_with(config, protocols, like, &library)
}

pub fn bench_with(config: RobotConfig, protocols: [Protocol; 2], like: Bus, library: &[u8]) -> Rig {
    let settings = Settings::default();
    let mut rig = Rig::with(config.clone(), settings, None);
    let buses: Buses = protocols.iter().map(|&protocol| Bus { protocol, ..like }).collect();
    let of = buses.clone();
    let store = flash::store(Some(library));
    let parameters = flash::parameters();
    rig.brain = Controller::with_parameters(config.clone(), buses, store, parameters, settings);
    let start = [0.9, -1.2, 0.0];
    let driven = config.channels.iter().zip(start);
    let driven = driven.filter(|(c, _)| protocols[usize::from(c.bus)] != Protocol::Rollwalk);
    rig.drives.list = driven.map(|(c, v)| Drive::new(&of[usize::from(c.bus)], *c, v)).collect();
    rig.run(40);
    rig
}

/// Arms the robot and waits for the end of alignment.
pub fn aligned(mut rig: Rig) -> Rig {
    assert_eq!(rig.brain.state(), State::Disarmed, "{:?}", rig.drives.list);
    rig.arm();
    rig.run_until(State::Ready, 2000);
    rig
}

fn ready(protocol: Protocol) -> Rig {
    aligned(bench(protocol))
}

fn playing(protocol: Protocol) -> Rig {
    let mut rig = ready(protocol);
    rig.play(CODE_WALK);
    rig.run(150);
    assert_eq!(rig.brain.state(), State::Playing, "{protocol:?}");
    rig
}

/// Checks that no drive moved further in a tick than its channel allows, plus its protocol's step.
fn assert_no_kick(rig: &Rig, what: &Protocol) {
    for drive in &rig.drives.list {
        let c = &drive.motor.channel;
        let allowed = c.max_rate * rig.settings.period_s() + 0.04;
        let step = drive.motor.largest_step;
        assert!(step <= allowed, "{what:?}: {:?} {} went {step} at once", c.kind, c.id);
    }
}

#[test]
fn every_protocol_arms_aligns_plays_and_comes_back() {
    for protocol in protocols() {
        let mut rig = ready(protocol);
        for (drive, safe) in rig.drives.list.iter().zip(STAND) {
            let error = (drive.motor.value - safe).abs();
            assert!(error < 0.02, "{protocol:?}: {} for {safe}", drive.motor.value);
        }
        let before: Vec<_> = rig.drives.list.iter().map(|d| d.motor.setpoints).collect();
        assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::Ok);
        rig.run(5);
        rig.run_until(State::Ready, 2000);
        for (drive, before) in rig.drives.list.iter().zip(before) {
            // At most one set-point per tick.
            let setpoints = drive.motor.setpoints - before;
            assert!((200..2000).contains(&setpoints), "{protocol:?}: {setpoints}");
        }
        assert!(rig.brain.faults().is_empty(), "{protocol:?}");
        assert_no_kick(&rig, &protocol);
    }
}

#[test]
fn no_protocol_kicks_when_it_is_enabled_again() {
    for protocol in protocols() {
        let mut rig = playing(protocol);
        rig.estop();
        rig.run(40);
        assert!(rig.drives.list.iter().all(|d| !d.motor.enabled), "{protocol:?}");
        rig.clear();
        // A person moves the legs. The drives keep their last set-point.
        (rig.drives.list[0].motor.value, rig.drives.list[1].motor.value) = (-0.7, 0.6);
        rig.drives.list[2].motor.value = 0.0;
        rig.run(40);
        rig.drives.list[0].motor.value = -0.71;
        rig.arm();
        rig.run_until(State::Ready, 2000);
        assert_no_kick(&rig, &protocol);
    }
}

#[test]
fn estop_is_the_next_frame_for_every_drive() {
    for protocol in protocols() {
        let mut rig = playing(protocol);
        rig.drives.clear_logs();
        rig.brain.estop(rig.now_us);
        rig.drives.carry(&mut rig.brain, rig.now_us);
        for drive in &rig.drives.list {
            assert!(!drive.motor.enabled, "{protocol:?}");
            assert_eq!(drive.motor.log.first(), Some(&DriveCommand::Disable), "{protocol:?}");
            assert!(drive.motor.log.iter().all(|s| s.is_harmless()), "{protocol:?}");
        }
        rig.drives.clear_logs();
        rig.run(200);
        for drive in &rig.drives.list {
            assert!(drive.motor.log.iter().all(|s| s.is_harmless()), "{:?}", drive.motor.log);
        }
    }
}

#[test]
fn what_waited_for_a_dead_bus_is_off() {
    for protocol in protocols() {
        let mut rig = playing(protocol);
        rig.drives.clear_logs();
        rig.buses_up = false;
        rig.run_until(State::Damped, 100);
        rig.run_until(State::TorqueOff, 1000);
        rig.run(500);
        rig.drives.list.iter_mut().for_each(|d| d.motor.value += 0.5);
        rig.buses_up = true;
        rig.run(100);
        for drive in &rig.drives.list {
            assert!(!drive.motor.enabled, "{protocol:?}");
            assert_eq!(drive.motor.log.first(), Some(&DriveCommand::Disable), "{protocol:?}");
            assert!(drive.motor.log.iter().all(|s| s.is_harmless()), "{protocol:?}");
        }
    }
}

/// A torque-on command that was interrupted, because the bus accepted nothing for a while, begins again with the current pose.
#[test]
fn an_order_that_stuck_halfway_begins_again() {
    for protocol in protocols() {
        for taken in 1..8 {
            let mut rig = bench(protocol);
            rig.arm();
            rig.buses_up = false;
            rig.run(1);
            rig.drives.clear_logs();
            for _ in 0..taken {
                rig.drives.pass(&mut rig.brain, rig.now_us, 0);
            }
            // The drive is moved while it is disabled.
            rig.run(3);
            for drive in rig.drives.list.iter_mut().filter(|d| !d.motor.enabled) {
                drive.motor.value += if drive.motor.is_wheel() { 0.0 } else { 0.3 };
            }
            rig.buses_up = true;
            rig.run(1);
            rig.run_until(State::Ready, 2000);
            assert_no_kick(&rig, &protocol);
        }
    }
}

/// A stop in the middle of a torque-on command drops its remaining frames.
#[test]
fn a_stop_goes_before_the_rest_of_an_order() {
    for protocol in protocols() {
        for taken in 0..8 {
            let mut rig = bench(protocol);
            rig.arm();
            rig.buses_up = false;
            rig.run(1);
            for _ in 0..taken {
                rig.drives.pass(&mut rig.brain, rig.now_us, 0);
            }
            rig.brain.estop(rig.now_us);
            rig.drives.clear_logs();
            while rig.drives.pass(&mut rig.brain, rig.now_us, 0) {}
            for drive in &rig.drives.list[..2] {
                assert_eq!(
                    drive.motor.log.first(),
                    Some(&DriveCommand::Disable),
                    "{protocol:?}, {taken}"
                );
                assert!(drive.motor.log.iter().all(|s| s.is_harmless()), "{protocol:?}, {taken}");
                assert!(!drive.motor.enabled, "{protocol:?}");
            }
        }
    }
}

/// Frames of a torque-on command follow each other directly: the controller sends no other frame to this drive between them.
#[test]
fn an_order_that_enables_is_whole() {
    for protocol in protocols() {
        let mut rig = bench(protocol);
        rig.drives.clear_logs();
        rig.arm();
        rig.run(2);
        for drive in &rig.drives.list {
            let log = &drive.motor.log;
            let enable =
                log.iter().position(|&s| s == DriveCommand::Enable).expect("it is enabled");
            let first = log[..enable].iter().rposition(|s| s.is_harmless()).map_or(0, |n| n + 1);
            let limp = |sent: &DriveCommand| matches!(sent, DriveCommand::Setpoint { kp, kd, .. } if *kp == 0.0 && *kd == 0.0);
            match (protocol, &log[first..]) {
                (Protocol::Mit(_), [a, DriveCommand::Enable, b, ..]) => assert!(limp(a) && limp(b)),
                (
                    Protocol::CyberGear(_),
                    [
                        DriveCommand::Limits,
                        DriveCommand::Limits,
                        DriveCommand::Mode,
                        a,
                        DriveCommand::Enable,
                        b,
                        ..,
                    ],
                ) => assert!(limp(a) && limp(b)),
                (
                    Protocol::Odrive(_),
                    [
                        DriveCommand::Limits,
                        DriveCommand::Gains { kd, .. },
                        DriveCommand::Mode,
                        DriveCommand::Setpoint { .. },
                        DriveCommand::Enable,
                        ..,
                    ],
                ) => assert!((kd - drive.motor.channel.kd_nm_s_rad).abs() < 1e-4),
                (
                    Protocol::Dynamixel(servos),
                    [
                        DriveCommand::Limits,
                        DriveCommand::Limits,
                        DriveCommand::Setpoint { .. },
                        DriveCommand::Enable,
                        ..,
                    ],
                ) if servos.model.has_current() => {}
                (
                    Protocol::Dynamixel(servos),
                    [DriveCommand::Setpoint { .. }, DriveCommand::Enable, ..],
                ) if !servos.model.has_current() => {}
                // Torque limit; acceleration and speed, and for a joint the pose; torque on.
                (
                    Protocol::Feetech(_),
                    [
                        DriveCommand::Limits,
                        DriveCommand::Limits,
                        DriveCommand::Setpoint { .. },
                        DriveCommand::Enable,
                        ..,
                    ],
                ) => {}
                (
                    Protocol::Mit(_)
                    | Protocol::Feetech(_)
                    | Protocol::CyberGear(_)
                    | Protocol::Odrive(_)
                    | Protocol::Dynamixel(_),
                    log,
                ) => panic!("{protocol:?}: {log:?}"),
                (_, log) => {
                    let before = log.iter().take_while(|sent| **sent != DriveCommand::Enable);
                    let allowed = |sent: &&DriveCommand| {
                        !matches!(sent, DriveCommand::Odd | DriveCommand::Torque(_))
                    };
                    assert!(before.clone().all(|sent| allowed(&sent)), "{protocol:?}: {log:?}");
                }
            }
        }
    }
}

/// Other drives react to a silent drive: joints are damped where the protocol allows it, and otherwise limp. Wheels brake.
#[test]
fn a_silent_drive_damps_the_others_as_far_as_they_can() {
    for protocol in protocols() {
        let mut rig = playing(protocol);
        rig.drives.list[1].powered = false;
        rig.run_until(State::Damped, 100);
        rig.drives.clear_logs();
        rig.run(100);
        assert_eq!(rig.brain.state(), State::Damped);
        assert!(rig.brain.faults().contains(Fault::ActuatorSilent));
        let (joint, wheel) = (&rig.drives.list[0].motor, &rig.drives.list[2].motor);
        if protocol.capabilities().gains == UpdatePolicy::Never {
            assert!(!joint.enabled);
            assert!(joint.log.iter().all(|s| s.is_harmless()));
        } else {
            let damped = |s: &&DriveCommand| matches!(s, DriveCommand::Setpoint { kp, kd, .. } if *kp == 0.0 && *kd > 0.3);
            let count = joint.log.iter().filter(damped).count();
            assert!(joint.enabled && count >= 98, "{protocol:?}: {count}");
        }
        assert!(wheel.enabled && wheel.value.abs() < 0.02, "{protocol:?}: {}", wheel.value);
        rig.run_until(State::TorqueOff, 1000);
        rig.run(2);
        assert!(!rig.drives.list[0].motor.enabled && !rig.drives.list[2].motor.enabled);
    }
}

#[test]
fn a_drive_that_reports_a_fault_damps_all() {
    for protocol in
        [mit(4, AnswerId::Own), odrive(Version::V05), odrive(Version::V06), cybergear(), feetech()]
    {
        let mut rig = playing(protocol);
        match &mut rig.drives.list[0].inner.kind {
            Kind::Mit(drive) => drive.error = 1,
            Kind::Odrive(axis) => (axis.error, axis.closed_loop) = (0x40, false),
            Kind::CyberGear(motor) => motor.faults = 1 << 2,
            Kind::Feetech(servo) => servo.status = 1 << 5,
            _ => unreachable!(),
        }
        rig.run_until(State::Damped, 20);
        assert!(rig.brain.faults().contains(Fault::ActuatorFault), "{protocol:?}");
    }
}

/// A fault frame between two feedbacks without the fault.
#[test]
fn a_fault_that_is_told_once_is_heard() {
    let mut rig = playing(cybergear());
    let id = u32::from(rig.drives.list[0].motor.channel.id);
    let fault = rollwalk_protocol::can::Frame::extended(
        21 << 24 | id << 8 | 0xFD,
        &[0, 1, 0, 0, 0, 0, 0, 0],
    );
    rig.brain.on_actuator_frame(rig.now_us, 0, &fault.unwrap());
    let drive = &rig.drives.list[0];
    let Kind::CyberGear(motor) = &drive.inner.kind else { unreachable!() };
    rig.brain.on_actuator_frame(rig.now_us, 0, &motor.feedback(&drive.motor.shaft()));
    rig.run(1);
    assert_eq!(rig.brain.state(), State::Damped);
}

/// Faults that a drive latches must be cleared before torque can be switched on again. The controller clears them while torque
/// is off.
#[test]
fn faults_that_drives_keep_are_cleared_while_torque_is_off() {
    let mut rig = playing(odrive(Version::V06));
    if let Kind::Odrive(axis) = &mut rig.drives.list[0].inner.kind {
        (axis.error, axis.closed_loop) = (0x0100_0000, false);
    }
    rig.run_until(State::TorqueOff, 1000);
    rig.run(60);
    assert!(rig.drives.list[0].motor.log.contains(&DriveCommand::ClearFaults));
    rig.clear();
    rig.run(60);
    rig.arm();
    rig.run_until(State::Ready, 2000);
}

/// Channels of the telemetry messages marked as unanswered in `ticks` control periods.
fn unanswered(rig: &mut Rig, ticks: u32) -> Vec<u8> {
    let from = rig.heard.len();
    rig.run(ticks);
    let told = rig.heard[from..].iter().filter_map(|(_, message)| match message {
        FromController::JointTelemetry(joint) => Some(joint),
        _ => None,
    });
    told.filter(|joint| joint.status.is_unanswered()).map(|joint| joint.channel).collect()
}

/// A disturbed line is reported before it stops the robot.
#[test]
fn a_servo_that_does_not_answer_once_is_told_of_once() {
    for protocol in [dynamixel(), feetech()] {
        let mut rig = playing(protocol);
        assert_eq!(unanswered(&mut rig, 60), [0; 0], "{protocol:?}");
        rig.drives.list[1].mute = true;
        rig.run(1);
        rig.drives.list[1].mute = false;
        assert_eq!(unanswered(&mut rig, 60), [1], "{protocol:?}");
        assert_eq!(unanswered(&mut rig, 60), [0; 0], "{protocol:?}");
        assert_eq!(rig.brain.state(), State::Playing);
        // While torque is off, switches are sent before each query.
        rig.command(Action::Disarm);
        rig.run_until(State::Disarmed, 2000);
        assert_eq!(unanswered(&mut rig, 60), [0; 0], "{protocol:?}");
    }
    // Drives on CAN need no query, or send on timers.
    let mut rig = playing(odrive(Version::V06));
    assert_eq!(unanswered(&mut rig, 60), [0; 0]);
}

/// Heartbeats contain no pose, and continue after a failure of the encoder.
#[test]
fn only_a_pose_is_a_sign_of_life() {
    let mut rig = playing(odrive(Version::V06));
    let id = u16::from(rig.drives.list[0].motor.channel.id) << 5;
    rig.drives.list[0].powered = false;
    for _ in 0..100 {
        let alive =
            rollwalk_protocol::can::Frame::standard(id | 1, &[0, 0, 0, 0, 8, 0, 0, 0]).unwrap();
        rig.brain.on_actuator_frame(rig.now_us, 0, &alive);
        rig.step();
    }
    assert!(rig.brain.faults().contains(Fault::ActuatorSilent));
}

/// A Maestro cannot report the positions of its servos.
/// Readings of every channel in the messages of the next `ticks` control periods.
fn readings(rig: &mut Rig, ticks: u32) -> Vec<ActuatorReadings> {
    rig.heard.clear();
    rig.run(ticks);
    let of = |(_, message): &(u64, FromController)| match message {
        FromController::Readings(readings) => Some(*readings),
        _ => None,
    };
    rig.heard.iter().filter_map(of).collect()
}

/// Temperature and supply voltage reach the link, ten channels a second, with torque and without.
#[test]
fn temperature_and_voltage_are_told_of_those_that_report_them() {
    for (protocol, temperature_c, voltage_v) in [
        (dynamixel(), Some(35.0), Some(12.0)),
        (feetech(), Some(35.0), Some(12.0)),
        (cybergear(), Some(25.0), None),
        (mit(0, AnswerId::Own), Some(30.0), None),
        (Protocol::Rollwalk, None, None),
    ] {
        let mut rig = bench(protocol);
        for state in [State::Disarmed, State::Ready, State::Playing] {
            if state == State::Ready {
                rig = aligned(rig);
            } else if state == State::Playing {
                rig.play(CODE_WALK);
            }
            // Three servos of a line are read in 1.5 s.
            rig.run(200);
            let told = readings(&mut rig, 240);
            if (temperature_c, voltage_v) == (None, None) {
                assert_eq!(told, []);
                continue;
            }
            assert!((19..=21).contains(&told.len()), "{protocol:?}: {} in 2 s", told.len());
            for (index, of) in told.iter().enumerate() {
                let channel =
                    (usize::from(told[0].channel) + index) % rig.brain.config().channels.len();
                let expected =
                    ActuatorReadings { channel: channel as u8, temperature_c, voltage_v };
                assert_eq!(*of, expected, "{protocol:?}, {state:?}");
            }
        }
    }
}

/// Readings of a silent servo are out of date.
#[test]
fn a_silent_servo_has_no_temperature() {
    let mut rig = bench(dynamixel());
    rig.run(200);
    rig.drives.list[1].mute = true;
    rig.run(100);
    assert!(readings(&mut rig, 240).iter().all(|of| of.channel != 1));
}

#[test]
fn a_pose_that_nobody_measures_has_to_be_assumed() {
    let config = robot::config();
    let mixed = [maestro(), Protocol::Rollwalk];
    let mut rig = bench_of(config.clone(), mixed, Bus::default());
    let refused = rig.command(Action::ArmRequest);
    assert_eq!(refused.result, CommandResult::PoseUnknown);

    let mut rig = bench_of(config, mixed, Bus { pose: Pose::AssumedSafe, ..Bus::default() });
    // The pose in which the operator has placed the drives.
    for (drive, safe) in rig.drives.list.iter_mut().zip(STAND) {
        drive.motor.value = safe;
    }
    rig.arm();
    rig.run_until(State::Ready, 2000);
    assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::Ok);
    rig.run(5);
    rig.run_until(State::Ready, 2000);
    assert_no_kick(&rig, &maestro());
    assert!(rig.drives.list.iter().all(|d| d.motor.setpoints > 200));
    // The board stops sending. No signal remains, and servos that cannot be damped lose torque.
    rig.drives.list[0].motor.log.clear();
    rig.estop();
    rig.run(1);
    assert_eq!(rig.drives.list[0].motor.log.first(), Some(&DriveCommand::Disable));
    assert!(rig.drives.list.iter().all(|d| !d.motor.enabled));
    let joints =
        robot::config().channels.iter().filter(|c| c.kind == ChannelKind::JointPosition).count();
    assert_eq!(rig.drives.list.len(), joints);
}

fn set(rig: &mut Rig, parameter: Parameter, channel: u8, value: f32) -> ParameterResult {
    let parameter = parameter.code();
    rig.parameter(ParameterAction::Set { parameter, channel, value }).result
}

/// Gains are sent along the ramp and at its end, to one drive at a time, so that set-points are not delayed.
#[test]
fn drives_that_keep_gains_and_limits_are_told_new_ones_while_they_run() {
    let mut rig = ready(odrive(Version::V06));
    rig.run(30);
    let from = rig.drives.list[0].motor.log.len();
    assert_eq!(set(&mut rig, Parameter::Kp, 0, 40.0), ParameterResult::Ok);
    assert_eq!(set(&mut rig, Parameter::MaxTorque, 0, 1.5), ParameterResult::Ok);
    rig.run(120);
    let log = &rig.drives.list[0].motor.log[from..];
    let gains = log.iter().filter_map(|sent| match sent {
        DriveCommand::Gains { kp, .. } => Some(*kp),
        _ => None,
    });
    let gains: Vec<f32> = gains.collect();
    // Three drives alternate: every third tick of half a second at 120 Hz.
    assert!((18..=22).contains(&gains.len()), "{gains:?}");
    assert!((gains[gains.len() - 1] - 40.0).abs() < 1e-3, "{gains:?}");
    assert!(gains.windows(2).all(|g| g[1] - g[0] > 0.0 && g[1] - g[0] < 1.01), "{gains:?}");
    let limits = log.iter().filter(|&&sent| sent == DriveCommand::Limits).count();
    assert!((18..=22).contains(&limits), "{limits}");
    let setpoints = log.iter().filter(|sent| matches!(sent, DriveCommand::Setpoint { .. })).count();
    assert!(setpoints >= 119, "{setpoints}");
}

#[test]
fn a_parameter_that_makes_no_difference_to_a_drive_is_refused() {
    for protocol in protocols() {
        let mut rig = bench(protocol);
        let (kp, torque) =
            (set(&mut rig, Parameter::Kp, 0, 10.0), set(&mut rig, Parameter::MaxTorque, 0, 2.0));
        let expected = match protocol {
            Protocol::Maestro(_) => (ParameterResult::NotSupported, ParameterResult::NotSupported),
            Protocol::Feetech(_) => (ParameterResult::NotSupported, ParameterResult::Ok),
            // A servo without a current sensor has no torque limit.
            Protocol::Dynamixel(servos) if servos.model.has_current() => {
                (ParameterResult::NotSupported, ParameterResult::Ok)
            }
            Protocol::Dynamixel(_) => {
                (ParameterResult::NotSupported, ParameterResult::NotSupported)
            }
            _ => (ParameterResult::Ok, ParameterResult::Ok),
        };
        assert_eq!((kp, torque), expected, "{protocol:?}");
    }
}

/// A set-point with a gain beyond the drive's scale could not be sent, and the robot would be damped in mid-stride.
#[test]
fn a_gain_that_the_drive_cannot_be_told_is_refused() {
    let mut config = robot::config();
    config.channels[0].kd_nm_s_rad = 3.0;
    for (protocol, expected) in [
        (mit(0, AnswerId::Own), ParameterResult::OutOfRange),
        (odrive(Version::V06), ParameterResult::Ok),
    ] {
        let mut rig = bench_of(config.clone(), [protocol; 2], Bus::default());
        assert_eq!(set(&mut rig, Parameter::Kd, 0, 5.0), ParameterResult::Ok);
        assert_eq!(set(&mut rig, Parameter::Kd, 0, 5.5), expected, "{protocol:?}");
    }
}
