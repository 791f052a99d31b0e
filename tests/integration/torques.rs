//! Tests of torques from plan to drive. The torques that the plan requires must reach the drives of every protocol, as a torque
//! or as an offset of the target.

mod bench;

use crate::desk_with_shipped_files;
use bench::Bench;
use rollwalk_host::session::Session;
use rollwalk_protocol::library::ClipId;
use rollwalk_protocol::wire::{Node, Parameter};
use rollwalk_robot::{Channel, Robot};
use rollwalk_tests::Desk;
use serde_json::Value;

const S: u64 = 1_000_000;
/// Command code of the walk.
const WALK: u8 = 2;
/// Clip of the walk.
const WALK_CLIP: ClipId = ClipId(1);

/// Buses of a robot with a different CAN protocol for each leg.
const CAN: &str = r#"
[[bus]]
number = 1
protocol = "mit"
model = "AK80-9"

[[bus]]
number = 2
protocol = "odrive"
firmware = "0.6"
reduction = -5.0
torque_constant_nm_a = 0.0306
estimates_hz = 120

[[bus]]
number = 3
protocol = "cybergear"
host_id = 253
max_position_rad = 12.5
"#;

/// Buses of a robot whose drives have no field for a torque; bus 2 has PWM outputs.
const WITHOUT_TORQUE: &str = r#"
[[bus]]
number = 0
protocol = "dynamixel"
model = "XM540-W150"
bit_rate = 3_000_000
watchdog_ms = 100
return_delay_us = 0

[[bus]]
number = 1
protocol = "maestro"
bit_rate = 200_000
pose = "assumed_safe"
centre_us = 1500
us_per_rad = 300
pulse_us = [500, 2500]
"#;

/// Creates a desk with a robot whose legs are on separate buses, and a library of `stand` and the motions, with codes from 2.
fn desk_with(robot: &str, buses: &str, motions: &[&str]) -> (Desk, Robot) {
    let desk = desk_with_shipped_files();
    let file = format!("robots/{robot}.toml");
    for (bus, leg) in ["front_left", "front_right", "rear_left", "rear_right"].iter().enumerate() {
        let text = desk.read_text(&file);
        let at = text.find(&format!("name = \"{leg}\"\n")).expect("the leg");
        let (before, limb) = text.split_at(at);
        let (limb, after) = limb.split_at(limb.find("\nbus = ").expect("its bus"));
        let rest = after.splitn(4, '\n').nth(3).unwrap_or_default();
        desk.write(&file, format!("{before}{limb}\nbus = {bus}\nfirst_id = 1\n{rest}"));
    }
    desk.write(&file, desk.read_text(&file) + buses);
    // Capability of an XM540.
    desk.edit(&file, "speed_max_rad_s = 6.05", "speed_max_rad_s = 5.0");
    desk.edit("motions/stand.toml", "agilebot.toml", &format!("{robot}.toml"));
    let mut library = format!("name = \"torques\"\nrobot = \"../{file}\"\nsafe = \"stand\"\n");
    for (code, name) in (1..).zip(["stand"].iter().chain(motions)) {
        library +=
            &format!("[[motion]]\nname = \"{name}\"\nfile = \"{name}.toml\"\ncode = {code}\n");
        desk.run(&["plan", &format!("motions/{name}.toml"), "-o", &format!("{name}.json")])
            .succeeds();
    }
    desk.write("motions/torques.toml", library + "[via_safe]\nduration_s = 1.2\nsamples = 25\n");
    desk.run(&["library", "build", "motions/torques.toml", "-o", "torques.rwl"]).succeeds();
    let robot = Robot::from_toml(&file, &desk.read_text(&file)).expect("a valid robot");
    (desk, robot)
}

fn plan(desk: &Desk, name: &str) -> Value {
    serde_json::from_str(&desk.read_text(name)).expect("JSON")
}

/// Returns a session with the robot in SAFE.
fn armed(desk: &Desk, robot: &Robot, pwm: Option<u8>) -> Session<Bench> {
    let bench = Bench::new(robot, &desk.read("torques.rwl"), pwm);
    let mut session = Session::connect(bench, Node::new(1).expect("a node")).expect("a controller");
    session.run_for(S / 2).expect("the bench runs");
    session.arm().expect("it can be armed");
    session
}

/// Torque of a channel in a sample of a plan, N·m.
fn torque_nm(sample: &Value, channel: usize) -> f64 {
    let joints = sample["joint_torque_nm"].as_array().expect("torques");
    let wheel = || &sample["end_effectors"][channel - joints.len()]["motor_torque_nm"];
    joints.get(channel).unwrap_or_else(wheel).as_f64().expect("a torque")
}

#[test]
fn drives_are_sent_the_torques_of_the_plan_and_the_share_that_is_set() {
    let (desk, robot) = desk_with("agilebot", CAN, &["walk"]);
    let plan = plan(&desk, "walk.json");
    // Samples are 50 ms apart, every third frame.
    assert_eq!(plan["samples"].as_array().map(Vec::len), Some(32));
    let mut session = armed(&desk, &robot, None);
    session.select(WALK).expect("a code");
    for share in [1.0, 0.5, 0.0] {
        session.set_parameter(Parameter::FeedForward, 0, share).expect("a share");
        // During the transition and the ramp of the share.
        session.run_for(3 * S).expect("the bench runs");
        session.bus_mut().told.clear();
        session.run_for(3 * S).expect("the bench runs");
        let channels: Vec<Channel> = robot.channels().collect();
        let (mut seen, mut largest_nm) = (vec![0; channels.len()], vec![0.0f64; channels.len()]);
        let mut scaled = 0;
        let told = session.bus().told.iter();
        for told in told.filter(|told| told.playing.clip == WALK_CLIP && told.playing.phase == 0.0)
        {
            if !told.playing.frame.is_multiple_of(3) {
                continue;
            }
            let actuator = channels[told.channel].actuator();
            let sample = &plan["samples"][usize::from(told.playing.frame / 3)];
            // The last stage before the wire scales gains and torque alike if together they exceed the limit.
            let scale = match channels[told.channel] {
                Channel::Joint(_) => f64::from(told.gains[0]) / actuator.kp_nm_rad,
                Channel::Wheel(..) => f64::from(told.gains[1]) / actuator.kd_nm_s_rad,
            };
            let rounding = if (scale - 1.0).abs() < 0.005 { 0.0 } else { 0.005 };
            scaled += usize::from(rounding > 0.0);
            let scale = if rounding > 0.0 { scale } else { 1.0 };
            let planned_nm = torque_nm(sample, told.channel) * f64::from(share) * scale;
            // Step of the protocol and of the library: half of 1/1024 of the limit.
            let step_nm = match actuator.bus {
                // 8 bits of mantissa, at least 1 mN·m.
                0 => 0.004 * planned_nm.abs() + 0.5e-3,
                // 12 bits for ±18 N·m. A wheel's torque also compensates for half a step of 12 bits for ±50 rad/s.
                1 if told.channel < 16 => 4.4e-3,
                1 => 4.4e-3 + 12.3e-3 * actuator.kd_nm_s_rad,
                // Thousandths of the torque of the motor, which rotates five times as fast.
                2 => 2.5e-3,
                // 16 bits over ±12 N·m.
                _ => 0.2e-3,
            };
            let step_nm = step_nm + rounding * planned_nm.abs();
            let tolerance_nm = step_nm + actuator.torque_max_nm / 2048.0 * f64::from(share) + 1e-6;
            let error_nm = (f64::from(told.torque_nm) - planned_nm).abs();
            assert!(error_nm <= tolerance_nm, "{share}: {told:?} for {planned_nm}: {error_nm}");
            seen[told.channel] += 1;
            largest_nm[told.channel] = largest_nm[told.channel].max(planned_nm.abs());
        }
        assert!(scaled < 20, "{scaled} of {seen:?}");
        // Nearly two cycles of 32 samples.
        assert!(seen.iter().all(|&count| count > 50), "{seen:?}");
        // Knees carry the robot, on every bus.
        let knees = [2, 6, 10, 14].map(|knee| largest_nm[knee]);
        assert!(knees.iter().all(|knee_nm| *knee_nm >= 0.5 * f64::from(share)), "{knees:?}");
    }
    session.return_to_safe().expect("the way home");
    session.disarm().expect("the robot is at home");
}

/// Compares targets in SAFE, where the robot carries its weight.
#[test]
fn drives_without_a_field_for_torques_are_sent_targets_that_stand_for_them() {
    let (desk, robot) = desk_with("legbot", WITHOUT_TORQUE, &[]);
    let plan = plan(&desk, "stand.json");
    let sample = &plan["samples"].as_array().expect("samples")[0];
    let mut session = armed(&desk, &robot, Some(2));
    for share in [1.0, 0.0] {
        session.set_parameter(Parameter::FeedForward, 0, share).expect("a share");
        session.run_for(S).expect("the bench runs");
        session.bus_mut().told.clear();
        session.run_for(S / 10).expect("the bench runs");
        let channels: Vec<Channel> = robot.channels().collect();
        let (mut seen, mut largest_rad) = (vec![0; channels.len()], vec![0.0f64; channels.len()]);
        for told in &session.bus().told {
            let actuator = channels[told.channel].actuator();
            let planned_nm = torque_nm(sample, told.channel) * f64::from(share);
            let planned_rad = sample["joint_rad"][told.channel].as_f64().expect("an angle");
            // Half a step: of 4096 steps per turn, of quarters of a microsecond, of 16 bits of 20 ms. The last has torques.
            let (step_rad, torque_nm) = match actuator.bus {
                0 => (0.77e-3, 0.0),
                1 => (0.42e-3, 0.0),
                2 => (0.51e-3 + (0.004 * planned_nm.abs() + 0.5e-3) / actuator.kp_nm_rad, 0.0),
                _ => (0.1e-3, planned_nm),
            };
            let offset_rad = (planned_nm - torque_nm) / actuator.kp_nm_rad;
            let error_rad = (f64::from(told.value) - planned_rad - offset_rad).abs();
            // Steps of angle and torque of the library.
            let quantum_nm = actuator.torque_max_nm / 1024.0;
            let tolerance_rad = step_rad + 0.49e-3 + 0.5 * quantum_nm / actuator.kp_nm_rad;
            assert!(error_rad <= tolerance_rad, "{told:?} for {planned_rad}: {error_rad}");
            let error_nm = (f64::from(told.torque_nm) - torque_nm).abs();
            assert!(error_nm <= 0.5 * quantum_nm + 0.004 * torque_nm.abs() + 0.5e-3, "{told:?}");
            seen[told.channel] += 1;
            largest_rad[told.channel] = largest_rad[told.channel].max(offset_rad.abs());
        }
        assert!(seen.iter().all(|&count| count >= 10), "{seen:?}");
        // Some joint of each such leg has an offset of several tolerances, so a missing one would show.
        let legs = largest_rad.chunks(4).take(3);
        let largest = legs.map(|leg| leg.iter().copied().fold(0.0, f64::max)).collect::<Vec<_>>();
        assert!(largest.iter().all(|rad| *rad >= 5e-3 * f64::from(share)), "{largest:?}");
    }
}
