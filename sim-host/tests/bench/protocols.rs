//! Robots whose drives use their makers' protocols over CAN, in virtual time. They are armed, follow, stop, are cleared and
//! follow again. No harm results when a drive falls silent.

use crate::robot::{self, ROLL_RAD_S};
use crate::{S, connect};
use rollwalk_bus::candump::LogEntry;
use rollwalk_host::session::Session;
use rollwalk_protocol::actuators::bus::{Bus, ControlLoop, Protocol};
use rollwalk_protocol::actuators::cybergear::{CyberGear, SAMPLE_MAX_RAD};
use rollwalk_protocol::actuators::mit::{AnswerId, MODELS, Mit};
use rollwalk_protocol::actuators::odrive::{Odrive, Version};
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::library::ClipId;
use rollwalk_protocol::wire::State;
use rollwalk_robot::Robot;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::faults::{Fault as InjectedFault, FaultKind};
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::record::tracking_errors;
use rollwalk_sim_host::rig::Rig;

fn on(protocol: Protocol) -> Bus {
    Bus { protocol, ..Bus::default() }
}

fn mit(model: usize, answers_from: AnswerId) -> Bus {
    on(Protocol::Mit(Mit { model: MODELS[model], answers_from }))
}

fn odrive(version: Version, reduction: f32) -> Bus {
    let (torque_constant_nm_a, estimates_hz) = (0.03, 125);
    on(Protocol::Odrive(Odrive { version, reduction, torque_constant_nm_a, estimates_hz }))
}

fn cybergear() -> Bus {
    on(Protocol::CyberGear(CyberGear { host: 0xFD, max_position_rad: SAMPLE_MAX_RAD }))
}

/// Kinds of drives on CAN. All mini cheetah drives answer with one identifier.
fn kinds() -> Vec<(&'static str, Bus)> {
    vec![
        ("mini cheetah", mit(6, AnswerId::Master(0))),
        ("AK80-9", mit(4, AnswerId::Own)),
        ("ODrive 0.5", odrive(Version::V05, -9.0)),
        ("ODrive 0.6", odrive(Version::V06, 1.0)),
        ("CyberGear", cybergear()),
    ]
}

/// Leg with hip and wheel on bus 0 and the knee on bus 1.
pub fn leg(buses: [Bus; 2]) -> Robot {
    Robot { buses: [(0, buses[0]), (1, buses[1])].into(), ..robot::robot() }
}

fn rig(robot: &Robot) -> Rig {
    Rig::new(robot).unwrap()
}

/// Robot with its library, in SAFE.
pub fn armed(robot: &Robot) -> Session<Rig> {
    let mut session = connect(rig(robot));
    // A motor that was just switched on has reported no pose yet.
    session.run_for(S / 2).unwrap();
    let library = robot::library_for(&robot.controller_config().unwrap());
    session.flash(&library, |_| {}).unwrap();
    session.arm().unwrap();
    session
}

/// Plays the swing and the roll, and returns to SAFE.
pub fn play(session: &mut Session<Rig>) {
    for code in [robot::SWING, robot::ROLL] {
        session.select(code).unwrap();
        session.run_for(3 * S).unwrap();
    }
    session.return_to_safe().unwrap();
}

/// Checks that the robot followed its set-points.
#[track_caller]
fn assert_followed(rig: &Rig, name: &str) {
    let errors = tracking_errors(rig.config(), rig.records());
    assert!(errors.len() >= 7, "{name}: {errors:?}");
    for (clip, error) in &errors {
        // As with the Rollwalk profile: 2.4 rad/s times half a control period of 1/240 s is 10 mrad; weight 7 mrad. The
        // rounding of MIT drives is 0.4 mrad; that of their speed is 16 mrad/s times kd / kp, 0.4 mrad.
        assert!(error.joint_rad > 1e-4 && error.joint_rad < 0.027, "{name}: {clip:?} {error:?}");
        // 9 rad/s²: delay 1/120 s, time constant 5 mN·m·s² / 0.5.
        assert!(error.wheel_rad_s < 0.22, "{name}: {clip:?} {error:?}");
    }
    let rolling = rig.records().iter().filter(|record| record.clip == ClipId(2));
    let fastest = rolling.map(|record| record.measured[2]).fold(0.0, f32::max);
    assert!((fastest - ROLL_RAD_S).abs() < 0.02, "{name}: {fastest}");
    assert_on_time(rig, name);
}

/// Checks that set-points crossed their bus within their control period.
#[track_caller]
fn assert_on_time(rig: &Rig, name: &str) {
    // An ODrive gets one set-point per period like the others. Time is virtual, and the buses have room.
    let missed = rig.records().iter().filter(|record| record.missed > 0).count();
    assert_eq!(missed, 0, "{name}: {missed} of {}", rig.records().len());
}

/// Plays a leg on the given buses, stops it by an emergency stop, clears it and plays it again. Returns the rig.
#[track_caller]
pub fn stopped_and_played_again(buses: [Bus; 2], name: &str) -> Rig {
    let mut session = armed(&leg(buses));
    play(&mut session);
    session.select(robot::SWING).unwrap();
    session.run_for(S).unwrap();
    session.estop().unwrap();
    // The ODrive reports every 8 ms.
    session.run_for(S / 100).unwrap();
    let driving = session.bus().body().servos().iter().any(|servo| servo.is_driving());
    assert!(!driving, "{name}: torque after an emergency stop");
    session.run_for(S).unwrap();
    assert_eq!(session.status().unwrap().state, State::EStopped, "{name}");
    session.clear().unwrap();
    session.arm().unwrap();
    play(&mut session);
    session.disarm().unwrap();
    session.into_bus()
}

#[test]
fn every_protocol_follows_is_stopped_and_follows_again() {
    for (name, bus) in kinds() {
        assert_followed(&stopped_and_played_again([bus; 2], name), name);
    }
}

/// The robot lies down and reports a fault if the feedback of one drive is lost during playback.
#[test]
fn without_feedback_of_one_drive_the_robot_is_let_down() {
    for (name, bus) in kinds() {
        for kind in [FaultKind::Unpowered(1), FaultKind::Deaf(1)] {
            let mut session = armed(&leg([bus; 2]));
            session.select(robot::SWING).unwrap();
            session.run_for(2 * S).unwrap();
            let mut rig = session.into_bus();
            let from = rig.now();
            let until = SimTime::from_ms(60_000);
            rig.add_fault(InjectedFault { kind, from, until });
            let mut session = connect(rig);
            session.run_for(2 * S).unwrap();
            let status = session.status().unwrap();
            assert_eq!(status.state, State::TorqueOff, "{name}, {kind:?}: {status:?}");
            assert!(status.faults.contains(Fault::ActuatorSilent), "{name}, {kind:?}");
            let servos = session.bus().body().servos();
            let others = servos.iter().enumerate().filter(|(channel, _)| *channel != 1);
            assert!(others.clone().all(|(_, servo)| !servo.is_driving()), "{name}, {kind:?}");
        }
    }
}

/// The drives of a bus that is off are all lost. When the bus is restored, the robot can be cleared and armed.
#[test]
fn a_bus_that_was_off_can_be_used_again() {
    let faults = [
        (FaultKind::NoAck(Interface::Actuator(1)), State::TorqueOff),
        (FaultKind::BusOff(1), State::EStopped),
    ];
    for (name, bus) in kinds() {
        for (kind, state) in faults {
            let name = format!("{name}, {kind:?}");
            let mut session = armed(&leg([bus; 2]));
            session.select(robot::SWING).unwrap();
            session.run_for(S).unwrap();
            let mut rig = session.into_bus();
            let from = rig.now();
            let until = from + SimTime::from_ms(500);
            rig.add_fault(InjectedFault { kind, from, until });
            let mut session = connect(rig);
            session.run_for(3 * S).unwrap();
            let status = session.status().unwrap();
            assert_eq!(status.state, state, "{name}: {status:?}");
            // A bus that is off stays off until the operator clears. With factory settings, none of these drives has a
            // watchdog, so the knee's drive follows its last command.
            let cut_off = |channel| kind == FaultKind::BusOff(1) && channel == 1;
            for (channel, servo) in session.bus().body().servos().iter().enumerate() {
                assert_eq!(servo.is_driving(), cut_off(channel), "{name}: {channel}");
            }
            session.clear().unwrap();
            session.run_for(S / 10).unwrap();
            assert!(session.bus().body().servos().iter().all(|s| !s.is_driving()), "{name}");
            session.arm().unwrap();
            session.select(robot::SWING).unwrap();
            session.run_for(S).unwrap();
            let status = session.status().unwrap();
            assert_eq!(status.state, State::Playing, "{name}: {status:?}");
        }
    }
}

/// Combines two makers on one robot, with a loop that the controller closes for one of them.
#[test]
fn makers_and_loops_can_be_mixed() {
    let by_torque = Bus { control: ControlLoop::OnController, ..cybergear() };
    let mut robot = leg([odrive(Version::V06, 5.0), by_torque]);
    // With dead time, kd must be well below the inertia divided by two periods: 3 N·m·s/rad for a heavy rotor.
    let knee = &mut robot.joints[1].actuator;
    (knee.armature_kg_m2, knee.kp_nm_rad, knee.kd_nm_s_rad) = (0.05, 40.0, 1.0);
    let mut session = armed(&robot);
    play(&mut session);
    session.disarm().unwrap();
    let rig = session.into_bus();
    assert_on_time(&rig, "mixed");
    // The bus carries no set-point of the knee, so its angle is compared with the library's frames.
    assert!(rig.records().iter().all(|record| record.commanded[1].is_nan()));
    let swing = robot::motion(robot::SWING);
    let mut worst: f32 = 0.0;
    for record in rig.records().iter().filter(|record| record.clip == ClipId(1)) {
        let (frame, part) = (record.phase_frames as usize, record.phase_frames.fract() as f32);
        let at = |frame: usize| swing[3 * (frame % 60) + 1];
        let planned = at(frame) + part * (at(frame + 1) - at(frame));
        worst = worst.max((record.measured[1] - planned).abs());
    }
    // With a pose that is 1.5 periods old, the loop leads by 2.4 rad/s × 12 ms = 29 mrad. In quadrature, 15 rad/s² times 0.05
    // kg·m² divided by kp is 19 mrad. The weight adds 5 mrad.
    assert!(worst > 5e-3 && worst < 0.045, "{worst}");
}

#[test]
fn cybergears_speak_with_identifiers_of_29_bits_and_others_do_not() {
    let extended = |rig: &Rig, bus| {
        let frames = rig.log().iter().filter(|entry| entry.interface == Interface::Actuator(bus));
        let frames: Vec<_> = frames.map(|entry| entry.frame).collect();
        let count = frames.iter().filter(|f| f.extended_id().is_some()).count();
        (count, frames.len())
    };
    let mut session = armed(&leg([cybergear(), mit(4, AnswerId::Own)]));
    session.run_for(S).unwrap();
    let rig = session.into_bus();
    let ((gears, all), (none, others)) = (extended(&rig, 0), extended(&rig, 1));
    assert_eq!((gears, none), (all, 0));
    assert!(all > 400 && others > 200, "{all} {others}");
    // Their logs can be read again.
    let line = rig.log().iter().rfind(|entry| entry.interface == Interface::Actuator(0)).unwrap();
    let again = rollwalk_bus::candump::parse::<Interface>(&line.to_string()).unwrap();
    assert_eq!(again, [LogEntry { ..*line }]);
}

#[test]
fn a_slower_bus_is_as_slow_as_its_file_says() {
    let load = |bit_rate| {
        let bus = Bus { bit_rate, ..mit(4, AnswerId::Own) };
        let mut session = armed(&leg([bus, bus]));
        let (before, start) = (session.bus().bus_statistics(), session.bus().now());
        session.run_for(S).unwrap();
        let (after, span) = (session.bus().bus_statistics(), session.bus().now() - start);
        after[1].1.since(&before[1].1).load(span)
    };
    let (fast, slow) = (load(1_000_000), load(250_000));
    // Each count may differ by one frame at both ends of its second: 135 bits of 58,000, twice.
    assert!((slow / fast - 4.0).abs() < 0.02, "{fast} {slow}");
}

/// Tests the example of the documentation.
#[test]
fn the_shipped_leg_follows() {
    let text = include_str!("../../../shipped/robots/test_leg.toml");
    let robot = Robot::from_toml("test_leg.toml", text).unwrap();
    let mut session = armed(&robot);
    play(&mut session);
    session.disarm().unwrap();
    let rig = session.into_bus();
    for (clip, error) in tracking_errors(rig.config(), rig.records()) {
        // Half a control period at 2.4 rad/s is 10 mrad. 0.17 N·m of weight divided by kp is 3 mrad, 15 rad/s² times 0.012
        // kg·m² another 3 mrad, rounding 0.8 mrad.
        assert!(error.joint_rad < 0.017, "{clip:?} {error:?}");
        // 9 rad/s²: delay 1/120 s, time constant 1.2 mN·m·s² / 0.5.
        assert!(error.wheel_rad_s < 0.1, "{clip:?} {error:?}");
    }
}
