//! Properties of drives that documents specify but that no controller of this project relies on.

use crate::{Answer, Drive, DriveCommand, Electronics, Kind, Shaft};
use rollwalk_protocol::actuators::bus::{Bus, ControlLoop, Protocol};
use rollwalk_protocol::actuators::cybergear::{CyberGear, SAMPLE_MAX_RAD};
use rollwalk_protocol::actuators::dynamixel::{Dynamixel, packet::packet, table::XM430_W210};
use rollwalk_protocol::actuators::feetech::{self, Feetech, table::STS3215_C018};
use rollwalk_protocol::actuators::maestro::{Maestro, Pulse};
use rollwalk_protocol::actuators::mit::{AnswerId, MODELS, Mit};
use rollwalk_protocol::actuators::odrive::{Odrive, Version};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{Channel, ChannelKind};
use std::f64::consts::TAU;

const ID: u8 = 5;

fn joint() -> Channel {
    Channel {
        kind: ChannelKind::JointPosition,
        min: -1.0,
        max: 1.0,
        max_rate: 5.0,
        max_torque_nm: 3.0,
        kp_nm_rad: 20.0,
        kd_nm_s_rad: 0.5,
        bus: 0,
        id: ID,
    }
}

fn drive(protocol: Protocol) -> Drive {
    Drive::new(&Bus { protocol, ..Bus::default() }, &joint())
}

fn odrive(version: Version) -> Drive {
    let (reduction, torque_constant_nm_a, estimates_hz) = (-2.0, 0.05, 100);
    drive(Protocol::Odrive(Odrive { version, reduction, torque_constant_nm_a, estimates_hz }))
}

fn at(position_rad: f64) -> Shaft {
    Shaft { position_rad, ..Shaft::default() }
}

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::standard(id, data).unwrap()
}

fn send_command(drive: &mut Drive, command: u16, data: &[u8]) -> DriveCommand {
    let frame = frame(u16::from(ID) << 5 | command, data);
    drive.on_frame(0, &frame, &Shaft::default()).expect("it is for this drive").0
}

fn floats(a: f32, b: f32) -> Vec<u8> {
    [a.to_le_bytes(), b.to_le_bytes()].concat()
}

/// Computes the cascade of `controller.cpp` by hand for position, velocity and torque.
#[test]
fn an_odrive_limits_the_speed_and_the_torque_that_its_loops_ask_for() {
    let mut drive = odrive(Version::V06);
    // 10 (turn/s)/turn, 0.02 N·m/(turn/s): kd = 0.02 · 4 / 2π at the output, kp = 10 kd.
    send_command(&mut drive, 0x1A, &10f32.to_le_bytes());
    send_command(&mut drive, 0x1B, &floats(0.02, 0.0));
    // 0.5 turn/s of the motor: a quarter turn a second of the output. 12 A: 0.6 N·m, 1.2 at the output.
    send_command(&mut drive, 0x0F, &floats(0.5, 12.0));
    send_command(&mut drive, 0x0B, &[3, 0, 0, 0, 1, 0, 0, 0]);
    // A tenth of a turn of the motor: −0.05 turns of the output. 0.05 turns × 10 = 0.5 turn/s of velocity.
    send_command(&mut drive, 0x0C, &floats(0.1, 0.0));
    assert_eq!(drive.law(&at(0.0)), None, "idle");
    assert_eq!(send_command(&mut drive, 0x07, &8u32.to_le_bytes()), DriveCommand::Enable);
    let kd = 0.02 * 4.0 / TAU;
    let far = drive.law(&at(0.0)).unwrap();
    assert!((far.kd_nm_s_rad - kd).abs() < 1e-9 && far.kp_nm_rad == 0.0, "{far:?}");
    assert!((far.speed_rad_s + 0.25 * TAU).abs() < 1e-6, "{far:?}");
    assert!((far.torque_limit_nm - 1.2).abs() < 1e-6, "{far:?}");
    let near = drive.law(&at(-0.04 * TAU)).unwrap();
    assert!((near.kp_nm_rad - 10.0 * kd).abs() < 1e-7 && near.speed_rad_s == 0.0, "{near:?}");
    assert!((near.position_rad + 0.05 * TAU).abs() < 1e-6, "{near:?}");
    // Torque added to a speed, in velocity mode: the motor's torque times −2.
    send_command(&mut drive, 0x0B, &[2, 0, 0, 0, 1, 0, 0, 0]);
    send_command(&mut drive, 0x0D, &floats(-0.2, 0.1));
    let speed = drive.law(&at(0.0)).unwrap();
    assert!((speed.speed_rad_s - 0.1 * TAU).abs() < 1e-6, "{speed:?}");
    assert!((speed.torque_nm + 0.2).abs() < 1e-6, "{speed:?}");
}

/// An invalid limit is refused, and the previous limits remain.
#[test]
fn an_odrive_takes_no_limit_below_0() {
    let mut drive = odrive(Version::V06);
    send_command(&mut drive, 0x0F, &floats(0.5, 12.0));
    send_command(&mut drive, 0x07, &8u32.to_le_bytes());
    let before = drive.law(&at(0.0));
    for (turns_s, current_a) in
        [(0.5, -1.0), (-0.5, 12.0), (f32::NAN, 12.0), (0.5, f32::NAN), (0.5, f32::INFINITY)]
    {
        let sent = send_command(&mut drive, 0x0F, &floats(turns_s, current_a));
        assert_eq!(sent, DriveCommand::Odd, "{turns_s} {current_a}");
        assert_eq!(drive.law(&at(0.0)), before, "{turns_s} {current_a}");
    }
}

/// Limits outside the manual's range of parameter 0x700B, 0 to 12 N·m, are refused.
#[test]
fn a_cybergear_takes_no_torque_limit_out_of_its_range() {
    let gear = CyberGear { host: 0xFD, max_position_rad: SAMPLE_MAX_RAD };
    let mut drive = drive(Protocol::CyberGear(gear));
    let mut send_command = |kind: u32, data: [u8; 8]| {
        let frame = Frame::extended(kind << 24 | 0xFD << 8 | u32::from(ID), &data).unwrap();
        let (sent, _) = drive.on_frame(0, &frame, &at(0.0)).expect("it is for this motor");
        (sent, drive.law(&at(0.0)).map(|law| law.torque_limit_nm))
    };
    let limit = |nm: f32| {
        let [a, b, c, d] = nm.to_le_bytes();
        [0x0B, 0x70, 0, 0, a, b, c, d]
    };
    assert_eq!(send_command(3, [0; 8]), (DriveCommand::Enable, Some(12.0)));
    assert_eq!(send_command(18, limit(2.5)), (DriveCommand::Limits, Some(2.5)));
    for nm in [-1.0, 12.5, f32::NAN, f32::INFINITY] {
        assert_eq!(send_command(18, limit(nm)), (DriveCommand::Odd, Some(2.5)), "{nm}");
    }
    assert_eq!(send_command(18, limit(0.0)), (DriveCommand::Limits, Some(0.0)));
}

#[test]
fn an_odrive_that_was_stopped_or_cannot_do_it_stays_idle() {
    for (version, bits) in [(Version::V05, 0x4000u32), (Version::V06, 0x0200_0000)] {
        let mut drive = odrive(version);
        send_command(&mut drive, 0x07, &8u32.to_le_bytes());
        assert_eq!(send_command(&mut drive, 0x02, &[]), DriveCommand::Disable);
        assert_eq!(drive.law(&at(0.0)), None);
        let heartbeat = std::iter::from_fn(|| drive.on_timer(0, &at(0.0))).collect::<Vec<_>>();
        assert_eq!(heartbeat, [], "its timers begin later");
        let told: Vec<_> = std::iter::from_fn(|| drive.on_timer(10_000, &at(0.0))).collect();
        let error = [&bits.to_le_bytes()[..], &[1, 0, 0, 0]].concat();
        assert_eq!(told[0], frame(u16::from(ID) << 5 | 1, &error));
        send_command(&mut drive, 0x07, &8u32.to_le_bytes());
        assert_eq!(drive.law(&at(0.0)), None, "the error has to be cleared first");
        send_command(&mut drive, 0x18, &[0]);
        send_command(&mut drive, 0x07, &8u32.to_le_bytes());
        assert!(drive.law(&at(0.0)).is_some());
        // A ramp, an integral gain and truncated frames have no effect.
        for (command, data) in [
            (0x0B, vec![3, 0, 0, 0, 2, 0, 0, 0]),
            (0x1B, floats(0.02, 0.1)),
            (0x0C, vec![1, 2, 3]),
            (0x07, vec![]),
            (0x16, vec![]),
        ] {
            assert_eq!(send_command(&mut drive, command, &data), DriveCommand::Odd, "{command:#x}");
        }
    }
}

#[test]
fn an_odrive_speaks_as_often_as_it_was_set_to() {
    let mut drive = odrive(Version::V05);
    let mut counts = [0u32; 32];
    let mut now_us = 0;
    while now_us < 1_000_000 {
        now_us = now_us.max(drive.next_timer_us().unwrap());
        let id = drive.on_timer(now_us, &at(0.5)).unwrap().standard_id().unwrap();
        counts[usize::from(id & 0x1F)] += 1;
    }
    assert!(counts[0x01].abs_diff(10) <= 1, "{counts:?}");
    assert!(counts[0x09].abs_diff(100) <= 1 && counts[0x14].abs_diff(100) <= 1, "{counts:?}");
    // After a pause, missed messages are not sent.
    let late = now_us + 10_000_000;
    assert_eq!(std::iter::from_fn(|| drive.on_timer(late, &at(0.5))).count(), 3);
}

#[test]
fn an_mit_drive_answers_within_its_scale() {
    let model = MODELS[4];
    let mut drive = drive(Protocol::Mit(Mit { model, answers_from: AnswerId::Own }));
    let off = frame(ID.into(), &[0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD]);
    let shaft = Shaft { position_rad: 100.0, speed_rad_s: -200.0, ..Shaft::default() };
    let (sent, answer) = drive.on_frame(0, &off, &shaft).unwrap();
    assert_eq!(sent, DriveCommand::Disable);
    // Ends of the scale, and zero torque, which lies between two codes.
    assert_eq!(answer, Some(frame(ID.into(), &[ID, 0xFF, 0xFF, 0x00, 0x08, 0x00, 30, 0])));
    assert_eq!(drive.on_frame(0, &frame(6, &[0; 8]), &shaft), None, "for another");
    assert_eq!(drive.on_frame(0, &frame(ID.into(), &[0; 7]), &shaft), None, "cut");
    let zero = frame(ID.into(), &[0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE]);
    assert_eq!(drive.on_frame(0, &zero, &shaft).unwrap().0, DriveCommand::Odd);
}

fn sync_write(address: u16, data: &[u8]) -> Vec<u8> {
    let head = [address.to_le_bytes(), (data.len() as u16).to_le_bytes()].concat();
    packet(0xFE, 0x83, &[&head[..], &[ID], data].concat()).unwrap().to_vec()
}

/// Behaviour of address 98 according to the e-Manual.
#[test]
fn a_dynamixel_whose_watchdog_has_expired_takes_no_goal_until_it_is_told_0() {
    let model =
        Dynamixel { model: XM430_W210, watchdog_20ms: 5, return_delay_us: 0, reads_fast: false };
    let mut drive = drive(Protocol::Dynamixel(model));
    let send_command = |drive: &mut Drive, now_us, address, data: &[u8]| {
        drive.on_packet(now_us, &sync_write(address, data), &at(0.0)).0
    };
    send_command(&mut drive, 0, 116, &3000i32.to_le_bytes());
    assert_eq!(send_command(&mut drive, 0, 64, &[1]), [DriveCommand::Enable]);
    assert_eq!(send_command(&mut drive, 0, 98, &[5]), [DriveCommand::Watchdog]);
    drive.on_time(100_000);
    let law = drive.law(&at(0.0)).unwrap();
    assert!((law.position_rad - 952.0 / 4096.0 * TAU).abs() < 1e-9);
    assert_eq!((law.kp_nm_rad, law.kd_nm_s_rad), (20.0, 0.5), "of the robot file");
    drive.on_time(100_001);
    assert_eq!(drive.law(&at(0.0)), None);
    assert_eq!(send_command(&mut drive, 100_001, 116, &3000i32.to_le_bytes()), [DriveCommand::Odd]);
    send_command(&mut drive, 100_001, 98, &[0]);
    drive.on_time(200_000);
    assert!(drive.law(&at(0.0)).is_some());
    assert_eq!(drive.on_packet(0, &[0xFF, 0xFF], &at(0.0)), (vec![], None));
}

/// Checks the e-Manual's ping of servo 1, and the reaction of a servo to packets that violate Protocol 2.0.
#[test]
fn a_dynamixel_takes_whole_packets_alone() {
    let ping = [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01];
    assert_eq!(crate::dynamixel::crc16(&ping).to_le_bytes(), [0x19, 0x4E]);

    let model =
        Dynamixel { model: XM430_W210, watchdog_20ms: 0, return_delay_us: 0, reads_fast: false };
    let mut drive = drive(Protocol::Dynamixel(model));
    let on = sync_write(64, &[1]);
    let resummed = |mut bytes: Vec<u8>| {
        bytes.truncate(bytes.len() - 2);
        bytes.extend(crate::dynamixel::crc16(&bytes).to_le_bytes());
        bytes
    };
    for index in 0..on.len() {
        let mut wrong = on.clone();
        wrong[index] ^= 1;
        assert_eq!(drive.on_packet(0, &wrong, &at(0.0)), (vec![], None), "byte {index}");
    }
    for length in [on.len() as u16 - 8, on.len() as u16 - 6, 0] {
        let mut wrong = on.clone();
        [wrong[5], wrong[6]] = length.to_le_bytes();
        assert_eq!(drive.on_packet(0, &resummed(wrong), &at(0.0)), (vec![], None), "{length}");
    }
    assert_eq!(drive.law(&at(0.0)), None);
    assert_eq!(drive.on_packet(0, &on, &at(0.0)).0, [DriveCommand::Enable]);

    // −1 step of current and −3 steps of velocity contain a header: FF FF, FD FF FF FF.
    let torque_nm = -2.69e-3 * 3.0 / 2.3;
    let shaft = Shaft { torque_nm, speed_rad_s: -3.0 * 0.229 * TAU / 60.0, ..at(0.0) };
    let ask = packet(0xFE, 0x82, &[126, 0, 10, 0, ID]).unwrap();
    let answer = [
        &[0xFF, 0xFF, 0xFD, 0, ID, 15, 0, 0x55, 0][..],
        &[0xFF, 0xFF, 0xFD, 0xFD, 0xFF, 0xFF, 0xFF, 0, 8, 0, 0],
        &[0, 0],
    ];
    let (sent, said) = drive.on_packet(0, &ask, &shaft);
    let bytes = resummed(answer.concat());
    let answer = Answer { bytes, turn: 0, delay_us: 0, is_part: false };
    assert_eq!((sent, said), (vec![DriveCommand::Query], Some(answer)));
    // The same in the other direction.
    let goal = i32::from_le_bytes([0xFF, 0xFF, 0xFD, 0xFF]);
    let stuffed = sync_write(116, &goal.to_le_bytes());
    assert_eq!(stuffed.len(), 8 + 4 + 1 + 5 + 2);
    assert!(matches!(
        drive.on_packet(0, &stuffed, &at(0.0)).0[..],
        [DriveCommand::Setpoint { .. }]
    ));
    let goal_rad = f64::from(goal - 2048) / 4096.0 * TAU;
    assert!((drive.law(&at(0.0)).unwrap().position_rad - goal_rad).abs() < 1e-9);
    let mut bare = stuffed;
    let stuffing = bare.windows(2).rposition(|two| two == [0xFD, 0xFD]).unwrap();
    bare[stuffing + 1] = 0;
    assert_eq!(drive.on_packet(0, &resummed(bare), &at(0.0)), (vec![], None));
}

/// Checks the manual's examples 7 and 8, and the reaction of a servo to impossible values.
#[test]
fn a_feetech_servo_takes_whole_packets_alone() {
    assert_eq!(crate::feetech::complement(&[1, 2, 1]), 0xFB);
    let servos = Feetech { model: STS3215_C018, return_delay_us: 500 };
    let mut drive = drive(Protocol::Feetech(servos));
    let write = |address: u8, data: &[u8]| {
        let parameters = [&[address, data.len() as u8, ID][..], data].concat();
        feetech::packet::packet(0xFE, 0x83, &parameters).unwrap().to_vec()
    };
    let on = write(40, &[1]);
    for index in 0..on.len() {
        let mut wrong = on.clone();
        wrong[index] ^= 1;
        assert_eq!(drive.on_packet(0, &wrong, &at(0.0)), (vec![], None), "byte {index}");
    }
    assert_eq!(drive.on_packet(0, &on, &at(0.0)).0, [DriveCommand::Enable]);
    // 1024 steps from the centre are a quarter turn; half of 30 kg·cm.
    drive.on_packet(0, &write(42, &[0, 0x0C]), &at(0.0));
    drive.on_packet(0, &write(48, &[0xF4, 1]), &at(0.0));
    let law = drive.law(&at(0.0)).unwrap();
    assert!((law.position_rad - TAU / 4.0).abs() < 1e-9, "{law:?}");
    assert!((law.torque_limit_nm - 1.471).abs() < 1e-3, "{law:?}");
    for (address, data) in [
        (40, &[128][..]),
        (40, &[1, 0]),
        (41, &[10]),
        (42, &[0]),
        (48, &[0xE9, 3]),
        (48, &[1, 0x80]),
        (33, &[1]),
    ] {
        let (sent, said) = drive.on_packet(0, &write(address, data), &at(0.0));
        assert_eq!((sent, said), (vec![DriveCommand::Odd], None), "{address} {data:?}");
        assert_eq!(drive.law(&at(0.0)), Some(law), "{address}");
    }

    // The second of two servos waits for the first. −3 steps/s, −50.0 % of the torque.
    let ask = feetech::packet::packet(0xFE, 0x82, &[56, 8, 2, ID]).unwrap();
    let shaft = Shaft { speed_rad_s: -3.0 * TAU / 4096.0, torque_nm: -1.471, ..at(TAU / 4.0) };
    let bytes = [0xFF, 0xFF, ID, 10, 0, 0, 0x0C, 3, 0x80, 0xF4, 5, 120, 35];
    let bytes = [&bytes[..], &[crate::feetech::complement(&bytes[2..])]].concat();
    let answer = Answer { bytes, turn: 1, delay_us: 500, is_part: false };
    assert_eq!(drive.on_packet(0, &ask, &shaft), (vec![DriveCommand::Query], Some(answer)));

    let mut line = [&[3, 0xFF, 0xFF][..], &on, &on[..5]].concat();
    assert_eq!(drive.take_packet(&mut line), Some(on.clone()));
    assert_eq!((drive.take_packet(&mut line), line), (None, on[..5].to_vec()));
    drive.cut_power();
    assert_eq!(drive.law(&at(0.0)), None);
}

#[test]
fn a_maestro_takes_what_its_settings_frame() {
    let board = |device, crc| {
        let pulse = Pulse { us_per_rad: 500.0, ..Pulse::default() };
        drive(Protocol::Maestro(Maestro { device, crc, set_multiple: true, pulse }))
    };
    let aims = |drive: &mut Drive, bytes: &[u8]| {
        drive.on_packet(0, bytes, &at(0.0));
        drive.law(&at(0.0)).map(|law| law.position_rad)
    };
    // 1750 µs are 7000 quarters: 88 and 54 with 7 bits each. Example of the guide: the CRC of 83 01 is 17.
    let mut plain = board(None, false);
    assert_eq!(aims(&mut plain, &[0x84, ID, 88, 54]), Some(0.5));
    assert_eq!(aims(&mut plain, &[0x84, ID + 1, 0, 0]), Some(0.5), "another channel");
    assert_eq!(aims(&mut plain, &[0x84, ID, 0, 0]), None);
    let mut numbered = board(Some(12), false);
    assert_eq!(aims(&mut numbered, &[0xAA, 12, 0x04, ID, 88, 54]), Some(0.5));
    assert_eq!(aims(&mut numbered, &[0xAA, 13, 0x04, ID, 0, 0]), Some(0.5), "another board");
    let mut checked = board(None, true);
    assert_eq!(aims(&mut checked, &[0x84, ID, 88, 54, 0]), None, "a wrong sum");
    assert_eq!(crate::maestro::crc7(&[0x83, 0x01]), 0x17);
    let (_, errors) = checked.on_packet(0, &[0xA1, crate::maestro::crc7(&[0xA1])], &at(0.0));
    assert_eq!(errors.map(|answer| answer.bytes), Some(vec![0, 0]));
}

/// Checks that a bus with the loop on the controller configures its drives for torque.
#[test]
fn a_drive_for_torques_gives_torques() {
    let model =
        Dynamixel { model: XM430_W210, watchdog_20ms: 0, return_delay_us: 0, reads_fast: false };
    let protocol = Protocol::Dynamixel(model);
    let bus = Bus { protocol, control: ControlLoop::OnController, ..Bus::default() };
    let mut drive = Drive::new(&bus, &joint());
    drive.on_packet(0, &sync_write(64, &[1]), &at(0.0));
    let (sent, _) = drive.on_packet(0, &sync_write(102, &(-100i16).to_le_bytes()), &at(0.0));
    // 2.69 mA per step, 3.0 N·m at 2.3 A.
    let torque_nm = -100.0 * 2.69e-3 * 3.0 / 2.3;
    assert!(
        matches!(sent[..], [DriveCommand::Torque(t)] if (f64::from(t) - torque_nm).abs() < 1e-6)
    );
    let law = drive.law(&at(1.0)).unwrap();
    assert!((law.torque_nm - torque_nm).abs() < 1e-6 && law.kp_nm_rad == 0.0);
    drive.cut_power();
    assert_eq!(drive.law(&at(1.0)), None);
    assert!(matches!(drive.kind, Kind::Dynamixel(_)));
}
