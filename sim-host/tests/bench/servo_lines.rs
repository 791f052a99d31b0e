//! Servos on half-duplex serial lines in virtual time. They are armed, follow, stop and are cleared. Every packet takes time on
//! the line. A servo or line that falls silent does no harm.

use crate::S;
use crate::protocols::{armed, leg, play, stopped_and_played_again};
use crate::robot::{self, ROLL_RAD_S};
use rollwalk_bus::link::LinkBus;
use rollwalk_host::actuators::Actuators;
use rollwalk_host::catalog::Catalog;
use rollwalk_host::doctor::{Gravity, LinkKeyCheck, Observations, Traffic};
use rollwalk_host::session::Session;
use rollwalk_protocol::actuators::Codec;
use rollwalk_protocol::actuators::bus::{Bus, ControlLoop, Pose, Protocol};
use rollwalk_protocol::actuators::dynamixel::{Dynamixel, table::XM430_W210};
use rollwalk_protocol::actuators::feetech::{Feetech, table::STS3250};
use rollwalk_protocol::actuators::maestro::Maestro;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::library::ClipId;
use rollwalk_protocol::wire::State;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::faults::{Fault as InjectedFault, FaultKind};
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::record::tracking_errors;
use rollwalk_sim_host::rig::Rig;

fn dynamixel(bit_rate: u32, return_delay_us: u32, watchdog_20ms: u8) -> Bus {
    let servos = Dynamixel { model: XM430_W210, watchdog_20ms, return_delay_us, reads_fast: false };
    Bus { protocol: Protocol::Dynamixel(servos), bit_rate, ..Bus::default() }
}

fn feetech(return_delay_us: u32) -> Bus {
    let servos = Feetech { model: STS3250, return_delay_us };
    Bus { protocol: Protocol::Feetech(servos), ..Bus::default() }
}

/// Servos with the return delay as delivered.
fn usual() -> Bus {
    dynamixel(1_000_000, 500, 5)
}

fn fault(session: &mut Session<Rig>, kind: FaultKind, ms: u64) {
    let rig = session.bus_mut();
    let from = rig.now();
    rig.add_fault(InjectedFault { kind, from, until: from + SimTime::from_ms(ms) });
}

/// Largest lag of a joint, rad. It is the sum of 27 mrad as on CAN; 60 mrad from 2.4 rad/s times kd / kp = 25 ms, since
/// set-points have no speed field; 4 mrad from 1.5 ms of packets; and 1 mrad from half a step of 1.5 mrad.
const LAG_RAD: f64 = 0.092;

#[track_caller]
fn assert_followed(rig: &Rig, name: &str) {
    let errors = tracking_errors(rig.config(), rig.records());
    assert!(errors.len() >= 7, "{name}: {errors:?}");
    for (clip, error) in &errors {
        assert!(error.joint_rad > 1e-4 && error.joint_rad < LAG_RAD, "{name}: {clip:?} {error:?}");
        // 9 rad/s² times 1/120 s and 2 ms, 5 mN·m·s² / 0.5; half a step of 24 mrad/s.
        assert!(error.wheel_rad_s < 0.25, "{name}: {clip:?} {error:?}");
    }
    let rolling = rig.records().iter().filter(|record| record.clip == ClipId(2));
    let fastest = rolling.map(|record| record.measured[2]).fold(0.0, f32::max);
    // A step of velocity is 24 mrad/s.
    assert!((fastest - ROLL_RAD_S).abs() < 0.03, "{name}: {fastest}");
    let missed = rig.records().iter().filter(|record| record.missed > 0).count();
    assert_eq!(missed, 0, "{name}: {missed} of {}", rig.records().len());
    for (line, statistics) in rig.line_statistics() {
        assert!(statistics.packets > 1000, "{name}: {line} {statistics:?}");
    }
}

#[test]
fn servos_follow_are_stopped_and_follow_again() {
    let rates =
        [(1_000_000, 500), (1_000_000, 0), (2_000_000, 250), (3_000_000, 0), (4_000_000, 20)];
    for (bit_rate, delay_us) in rates {
        let name = format!("{bit_rate} bit/s, {delay_us} µs");
        let servos = dynamixel(bit_rate, delay_us, 5);
        assert_followed(&stopped_and_played_again([servos; 2], &name), &name);
    }
}

/// Servos of a line all answer in one packet, after one return delay.
#[test]
fn servos_that_are_read_fast_follow_are_stopped_and_follow_again() {
    for delay_us in [0, 500] {
        let servos = Dynamixel {
            model: XM430_W210,
            watchdog_20ms: 5,
            return_delay_us: delay_us,
            reads_fast: true,
        };
        let bus = Bus { protocol: Protocol::Dynamixel(servos), ..Bus::default() };
        let name = format!("fast, {delay_us} µs");
        assert_followed(&stopped_and_played_again([bus; 2], &name), &name);
    }
}

#[test]
fn feetech_servos_follow_are_stopped_and_follow_again() {
    for delay_us in [0, 100, 500] {
        let name = format!("Feetech, {delay_us} µs");
        assert_followed(&stopped_and_played_again([feetech(delay_us); 2], &name), &name);
    }
}

#[test]
fn the_same_run_puts_the_same_packets_on_the_line() {
    let packets = || {
        let mut session = armed(&leg([usual(); 2]));
        play(&mut session);
        session.into_bus().packets().to_vec()
    };
    let first = packets();
    assert!(first.len() > 1000 && first == packets());
    assert!(first.is_sorted_by_key(|packet| packet.at_us));
}

/// Hip and wheel are on bus 0. A query has 16 bytes, and the two answers have 21 bytes, each after 500 µs. A byte takes 10 µs.
#[test]
fn every_byte_takes_its_ten_bits_and_every_answer_its_delay() {
    let mut session = armed(&leg([usual(); 2]));
    let since_us = session.bus().now().as_us();
    session.run_for(S / 10).unwrap();
    let rig = session.into_bus();
    let on_0 = |packet: &&_| {
        let packet: &rollwalk_sim_host::interface::PacketEntry = packet;
        packet.interface == Interface::Actuator(0) && packet.at_us > since_us
    };
    let packets: Vec<_> = rig.packets().iter().filter(on_0).collect();
    let mut seen = 0;
    for three in packets.windows(3) {
        let [asked, first, second] = three else { unreachable!() };
        if asked.from_controller && !first.from_controller && !second.from_controller {
            assert_eq!(asked.bytes.len(), 16);
            for (before, answer) in [(asked, first), (first, second)] {
                let wait_us = answer.at_us - before.at_us;
                assert_eq!(wait_us, 500 + 10 * answer.bytes.len() as u64);
            }
            seen += 1;
        }
    }
    assert!(seen >= 11, "{seen} questions in 100 ms");
}

/// Feetech servos have no watchdog. Servos that receive the controller's commands switch torque off. A deaf servo keeps
/// following its previous command.
#[test]
fn feetech_servos_that_hear_the_controller_are_let_down() {
    for (kind, still_driving) in [(FaultKind::Unpowered(1), vec![]), (FaultKind::Deaf(1), vec![1])]
    {
        let mut session = armed(&leg([feetech(0); 2]));
        session.select(robot::SWING).unwrap();
        session.run_for(2 * S).unwrap();
        fault(&mut session, kind, 3_000);
        session.run_for(2 * S).unwrap();
        let status = session.status().unwrap();
        assert!(status.faults.contains(Fault::ActuatorSilent), "{kind:?}: {status:?}");
        let servos = session.bus().body().servos().iter().enumerate();
        let driving: Vec<_> = servos.filter(|(_, s)| s.is_driving()).map(|(i, _)| i).collect();
        assert_eq!(driving, still_driving, "{kind:?}");
        // The controller repeats the command until the servo acknowledges it.
        session.run_for(3 * S).unwrap();
        assert_eq!(session.status().unwrap().state, State::TorqueOff, "{kind:?}");
        assert!(!session.bus().body().servos().iter().any(|servo| servo.is_driving()));
    }
}

/// The robot lies down if one servo or its line is silent during playback, and its status contains the fault.
#[test]
fn without_answers_the_robot_is_let_down() {
    let faults =
        [FaultKind::Unpowered(1), FaultKind::Deaf(1), FaultKind::NoAck(Interface::Actuator(1))];
    for kind in faults {
        let mut session = armed(&leg([usual(); 2]));
        session.select(robot::SWING).unwrap();
        session.run_for(2 * S).unwrap();
        fault(&mut session, kind, 2_000);
        session.run_for(2 * S).unwrap();
        let status = session.status().unwrap();
        assert_eq!(status.state, State::TorqueOff, "{kind:?}: {status:?}");
        assert!(status.faults.contains(Fault::ActuatorSilent), "{kind:?}");
        // The knee's own watchdog has stopped it after 100 ms.
        let driving = session.bus().body().servos().iter().any(|servo| servo.is_driving());
        assert!(!driving, "{kind:?}");
        // After its return, the robot can be cleared, armed and played.
        session.run_for(S).unwrap();
        session.clear().unwrap();
        session.run_for(S / 10).unwrap();
        session.arm().unwrap();
        session.select(robot::SWING).unwrap();
        session.run_for(S).unwrap();
        assert_eq!(session.status().unwrap().state, State::Playing, "{kind:?}");
    }
}

/// Hip and wheel are on one line, and the wheel answers after the hip. The fault and the diagnosis name the hip.
#[test]
fn of_a_line_the_servo_that_is_silent_is_named() {
    let robot = leg([usual(); 2]);
    let mut session = armed(&robot);
    fault(&mut session, FaultKind::Unpowered(0), 5_000);
    session.run_for(2 * S).unwrap();
    let begin_us = session.bus().now_us();
    session.run_for(2 * S).unwrap();
    let (hello, rig) = (*session.hello(), session.into_bus());
    let mut heard = Traffic { span_us: 2 * S, ..Traffic::default() };
    let on_link = rig.log().iter().filter(|entry| entry.interface == Interface::Link);
    for entry in on_link.filter(|entry| entry.at_us >= begin_us) {
        heard.take(1, &entry.frame);
    }
    let silent = heard.faults[&Fault::ActuatorSilent.code()];
    assert_eq!(silent.channel, Some(0));
    let models = vec!["XM430-W210".to_owned(); 3];
    let actuators = Actuators::new(rig.config(), &robot.controller_buses(), models);
    let names = ["hip", "knee", "wheel"].map(str::to_owned).to_vec();
    let catalog = Catalog::of_robot("leg", 0, names).with_actuators(actuators);
    let findings = Observations {
        heard: &heard,
        has_host: false,
        hello: Some(&hello),
        refused: None,
        key: LinkKeyCheck::NotNeeded,
        transferring: false,
        gains: None,
        gains_unread: None,
        history: None,
        complaint: None,
        bitrate: 1_000_000,
        expected_config: None,
        catalog: Some(&catalog),
        config: None,
        bus: "sim",
    };
    let found = findings.diagnose();
    let says = |words: &str| found.iter().any(|finding| finding.what.contains(words));
    assert!(says("a servo does not answer (hip, "), "{found:#?}");
    assert!(says("no answer from any actuator on bus 0"), "{found:#?}");
    assert!(found.iter().any(|finding| finding.help.contains("if only hip (")), "{found:#?}");
    // Its temperature is reported, and nothing wrong is said of it.
    let blamed = found.iter().filter(|finding| finding.gravity == Gravity::Wrong);
    assert!(blamed.into_iter().all(|finding| !finding.what.contains("knee")), "{found:#?}");
}

/// A gap that is shorter than the controller's timeout causes no fault.
#[test]
fn a_short_gap_is_ridden_through() {
    let mut session = armed(&leg([usual(); 2]));
    session.select(robot::SWING).unwrap();
    session.run_for(2 * S).unwrap();
    fault(&mut session, FaultKind::NoAck(Interface::Actuator(0)), 50);
    session.run_for(2 * S).unwrap();
    let status = session.status().unwrap();
    assert_eq!((status.state, status.faults.is_empty()), (State::Playing, true), "{status:?}");
}

/// The controller computes the torque from a pose that is one period old.
#[test]
fn a_loop_can_be_closed_over_the_line() {
    let by_torque = Bus { control: ControlLoop::OnController, ..dynamixel(3_000_000, 0, 5) };
    let mut robot = leg([dynamixel(1_000_000, 100, 5), by_torque]);
    let knee = &mut robot.joints[1].actuator;
    (knee.armature_kg_m2, knee.kp_nm_rad, knee.kd_nm_s_rad) = (0.05, 40.0, 1.0);
    let mut session = armed(&robot);
    play(&mut session);
    assert_eq!(session.status().unwrap().state, State::Ready);
    session.run_for(S).unwrap();
    // In SAFE, its weight of 0.17 N·m divided by kp is 4 mrad; a step of current is 0.1 mrad.
    let error = session.bus().body().values()[1] - -0.6;
    assert!(error.abs() < 0.006, "{error}");
}

/// Hobby servos do not report their positions; their board answers for them.
#[test]
fn hobby_servos_behind_a_board_follow() {
    let board = Maestro::EXAMPLES[1];
    let protocol = Protocol::Maestro(board);
    let maestro = Bus { protocol, bit_rate: 115_200, pose: Pose::AssumedSafe, ..Bus::default() };
    let mut session = armed(&leg([usual(), maestro]));
    play(&mut session);
    session.disarm().unwrap();
    let rig = session.into_bus();
    for (clip, error) in tracking_errors(rig.config(), rig.records()) {
        assert!(error.joint_rad < LAG_RAD, "{clip:?} {error:?}");
    }
}
