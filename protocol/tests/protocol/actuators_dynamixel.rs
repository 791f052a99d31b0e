//! Tests of the Dynamixel codec against the e-Manual: `dxl/protocol2` (all its examples for the instructions used here),
//! `x/xm430-w210`, `x/xm540-w150`.

use crate::actuators_all::{joint, sent, wheel};
use proptest::prelude::*;
use rollwalk_protocol::actuators::dynamixel::packet::{
    BROADCAST, HEADER, MAX_PARTS, Message, Part, READ, REBOOT, ReceivedPacket, STATUS, WRITE,
    crc16, next, packet, take,
};
use rollwalk_protocol::actuators::dynamixel::table::{self, XM430_W210, XM540_W150};
use rollwalk_protocol::actuators::dynamixel::{
    Dynamixel, SyncWrite, fast_sync_read, goal_pwm, position_gains, sync_read,
};
use rollwalk_protocol::actuators::serial::{Answer, ReceiveBuffer};
use rollwalk_protocol::actuators::{
    ActuatorCommand, Codec, Command, Faults, MAX_PACKET, Refusal, SerialCodec, UpdatePolicy,
};
use std::f32::consts::{FRAC_PI_2, PI};

const SERVOS: Dynamixel =
    Dynamixel { model: XM430_W210, watchdog_20ms: 5, return_delay_us: 500, reads_fast: false };

fn bytes(hex: &str) -> Vec<u8> {
    hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn framed(stream: &[u8]) -> Vec<Message> {
    let mut deframer = ReceiveBuffer::default();
    let mut found = Vec::new();
    for &byte in stream {
        deframer.push(byte);
        while let Some(message) = take(&mut deframer, false) {
            found.push(message);
        }
    }
    while let Some(message) = take(&mut deframer, true) {
        found.push(message);
    }
    found
}

fn status(hex: &str) -> Message {
    framed(&bytes(hex)).pop().unwrap()
}

/// Example packets of the manual: Ping (0x01), Read, Write, Reboot, Sync Read, Sync Write.
#[test]
fn instructions_of_the_manual() {
    let ping = packet(1, 1, &[]).unwrap();
    assert_eq!(ping[..], bytes("FF FF FD 00 01 03 00 01 19 4E"));
    let ping = packet(BROADCAST, 1, &[]).unwrap();
    assert_eq!(ping[..], bytes("FF FF FD 00 FE 03 00 01 31 42"));
    let read = packet(1, READ, &[0x84, 0, 4, 0]).unwrap();
    assert_eq!(read[..], bytes("FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"));
    let write = packet(1, WRITE, &[0x74, 0, 0, 2, 0, 0]).unwrap();
    assert_eq!(write[..], bytes("FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89"));
    assert_eq!(packet(1, REBOOT, &[]).unwrap()[..], bytes("FF FF FD 00 01 03 00 08 2F 4E"));
    let read = sync_read(table::PRESENT_POSITION, 4, &[1, 2]).unwrap();
    assert_eq!(read[..], bytes("FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA"));
    let mut write = SyncWrite::new(table::GOAL_POSITION, 4);
    assert!(write.push(1, &150i32.to_le_bytes()) && write.push(2, &170i32.to_le_bytes()));
    let expected = "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87";
    assert_eq!(write.packet().unwrap()[..], bytes(expected));
}

/// Example answers of the manual to Ping, Read, Write and Sync Read.
#[test]
fn answers_of_the_manual() {
    for (hex, id, data) in [
        ("FF FF FD 00 01 07 00 55 00 06 04 26 65 5D", 1, &[0x06, 0x04, 0x26][..]),
        ("FF FF FD 00 02 07 00 55 00 06 04 26 6F 6D", 2, &[0x06, 0x04, 0x26][..]),
        ("FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0", 1, &[0xA6, 0, 0, 0][..]),
        ("FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE", 2, &[0x1F, 8, 0, 0][..]),
        ("FF FF FD 00 01 04 00 55 00 A1 0C", 1, &[][..]),
    ] {
        let message = status(hex);
        let told = message.status().unwrap();
        assert_eq!((told.id, told.alert, told.error, told.data), (id, false, 0, data), "{hex}");
        assert_eq!(SERVOS.decode(&message).unwrap().1.faults, Some(Faults::NONE));
    }
    // Our own ping, heard on a half-duplex line.
    let echo = status("FF FF FD 00 01 03 00 01 19 4E");
    assert_eq!((echo.status(), SERVOS.decode(&echo)), (None, None));
}

/// Packet that servos build together in answer to a fast sync read. Each part ends with the CRC of all bytes before it.
fn fast(answers: &[(u8, [u8; 10])]) -> Vec<u8> {
    let [low, high] = (1 + 14 * answers.len() as u16).to_le_bytes();
    let mut all = [&HEADER[..], &[BROADCAST, low, high, STATUS]].concat();
    for (id, data) in answers {
        all.extend([0, *id]);
        all.extend(data);
        all.extend(crc16(&all).to_le_bytes());
    }
    all
}

/// Parts extracted from a stream, each with the index of the byte after which it was complete. Afterwards the line is silent.
fn parts(stream: &[u8]) -> Vec<(usize, u8, [u8; 10])> {
    let mut line = ReceiveBuffer::default();
    let mut found = Vec::new();
    for (at, &byte) in stream.iter().enumerate() {
        line.push(byte);
        while let Some(taken) = next(&mut line, false, true) {
            let ReceivedPacket::Part(Part { id, error: 0, data }) = taken else { continue };
            found.push((at, id, data));
        }
    }
    while let Some(taken) = next(&mut line, true, true) {
        let ReceivedPacket::Part(Part { id, error: 0, data }) = taken else { continue };
        found.push((stream.len(), id, data));
    }
    found
}

/// Query and answer of the manual's example of fast sync read. The answer has parts of 4 bytes, so only its checksums are
/// compared.
#[test]
fn fast_sync_read_of_the_manual() {
    let question = fast_sync_read(table::PRESENT_POSITION, 4, &[3, 7, 4]).unwrap();
    assert_eq!(question[..], bytes("FF FF FD 00 FE 0A 00 8A 84 00 04 00 03 07 04 20 F2"));
    let answer = bytes(
        "FF FF FD 00 FE 19 00 55 00 03 A6 00 00 00 84 08 00 07 1F 08 00 00 16 CA \
         00 04 FF 03 00 00 D1 9E",
    );
    for end in [16, 24, 32] {
        let (body, sum) = answer[..end].split_last_chunk().unwrap();
        assert_eq!(crc16(body), u16::from_le_bytes(*sum), "{end}");
    }
}

/// Parts before a silent servo or a damaged part are received, but no later ones. Headers are searched in bytes that turn out
/// not to be data, and never in valid data.
#[test]
fn parts_of_an_answer_of_many() {
    let header = [0xFF, 0xFF, 0xFD, 0, 0xFE, 15, 0, 0x55, 0xFF, 0xFF];
    let three = [(3, [1; 10]), (7, header), (4, [2; 10])];
    let whole = fast(&three);
    assert_eq!(whole.len(), 8 + 3 * 14);
    let all: Vec<_> = (1..=3).zip(three).map(|(n, (id, data))| (7 + 14 * n, id, data)).collect();
    assert_eq!(parts(&whole), all);
    assert_eq!(parts(&whole[..whole.len() - 1])[..], all[..2]);
    for at in 8..whole.len() {
        let mut wrong = whole.clone();
        wrong[at] ^= 0x40;
        assert_eq!(parts(&wrong)[..], all[..(at - 8) / 14], "byte {at}");
        // The next packet is complete again.
        let after = parts(&[&wrong[..], &whole].concat());
        assert!(after.len() >= 3 && after[after.len() - 1].1 == 4, "byte {at}: {after:?}");
    }
    // After a cut packet and silence.
    let servos = Dynamixel { reads_fast: true, ..SERVOS };
    let mut line = ReceiveBuffer::default();
    whole[..30].iter().for_each(|&byte| line.push(byte));
    let take = |line: &mut ReceiveBuffer, silent| servos.take(line, silent);
    assert!(take(&mut line, false).is_some() && take(&mut line, false).is_none());
    assert!(take(&mut line, true).is_none() && line.bytes().is_empty());
    whole.iter().for_each(|&byte| line.push(byte));
    assert_eq!(std::iter::from_fn(|| take(&mut line, false)).count(), 3);
}

/// Packets after missing or damaged parts are extracted as soon as they are complete.
#[test]
fn a_packet_after_parts_that_failed() {
    let whole = fast(&[(3, [1; 10]), (7, [2; 10])]);
    let answer = packet(5, STATUS, &[0]).unwrap();
    let message = Message { id: 5, instruction: STATUS, parameters: [0].into_iter().collect() };
    let expected = Some(ReceivedPacket::Message(message));
    // Only the beginning has arrived, and its bytes were taken before the line was silent.
    let mut line = ReceiveBuffer::default();
    whole[..8].iter().for_each(|&byte| line.push(byte));
    assert_eq!(next(&mut line, false, true), None);
    assert!(line.bytes().is_empty());
    assert_eq!(next(&mut line, true, true), None);
    answer.iter().for_each(|&byte| line.push(byte));
    assert_eq!(next(&mut line, false, true), expected);
    // A damaged part whose data look like the length of a long packet.
    let mut line = ReceiveBuffer::default();
    let mut wrong = fast(&[(3, [0, 0, 0, 100, 0, 0, 0, 0, 0, 0])]);
    wrong[21] ^= 1;
    wrong.iter().chain(&answer).for_each(|&byte| line.push(byte));
    assert_eq!(next(&mut line, false, true), expected);
}

/// A fast read is used for up to as many servos as fit in one packet, an ordinary sync read for more.
#[test]
fn a_line_of_many_is_read_as_ever() {
    let servos = Dynamixel { reads_fast: true, ..SERVOS };
    let query = |id| ActuatorCommand { id, command: Command::Query };
    let instruction = |count| {
        let mut sent = Vec::new();
        let orders: Vec<_> = (0..count).map(query).collect();
        servos.encode(&orders, &mut |packet| sent.push(packet[7])).unwrap();
        sent
    };
    assert_eq!(MAX_PARTS, 17);
    assert_eq!((instruction(17), instruction(18)), (vec![0x8A], vec![0x82]));
    // Set-points have 30 + 8 n bytes as always; 8 bytes, and 14 for each answer; one delay.
    let fast = servos.traffic(12);
    assert_eq!((fast.bits_per_period, fast.waiting_us_per_period), (10 * (38 + 22 * 12), 500));
    assert_eq!(servos.traffic(18), SERVOS.traffic(18));
}

/// Stuffing inserts 0xFD after "0xFF 0xFF 0xFD" in the parameters, and counts in the length.
#[test]
fn stuffing() {
    let stuffed = packet(1, WRITE, &[0xFF, 0xFF, 0xFD, 0, 0xFF, 0xFF, 0xFF, 0xFD]).unwrap();
    assert_eq!(stuffed[4..stuffed.len() - 2], bytes("01 0D 00 03 FF FF FD FD 00 FF FF FF FD FD"));
    let message = framed(&stuffed).pop().unwrap();
    assert_eq!(message.parameters[..], bytes("FF FF FD 00 FF FF FF FD"));
}

/// Bit 7 of the error byte is the alert. The other bits contain the reason why the instruction was not executed.
#[test]
fn error_byte() {
    let answer = |error: u8| framed(&packet(3, STATUS, &[error]).unwrap()).pop().unwrap();
    let faults = |error| SERVOS.decode(&answer(error)).unwrap().1.faults.unwrap();
    // Error 4, "Data Range Error", answers a goal after the bus watchdog has expired.
    assert_eq!(faults(4), Faults::REFUSED);
    assert_eq!(faults(0x80), Faults::OTHER);
    assert!(faults(0x87).contains(Faults::REFUSED) && faults(0x87).contains(Faults::OTHER));
    assert_eq!(answer(0x84).status().unwrap().error, 4);
    let nothing = framed(&packet(3, STATUS, &[]).unwrap()).pop().unwrap();
    assert_eq!(nothing.status(), None);
}

/// Control tables of the two servos: addresses, model numbers, limits.
#[test]
fn control_table() {
    assert_eq!((XM430_W210.number, XM540_W150.number), (1030, 1130));
    assert_eq!((XM430_W210.max_current, XM540_W150.max_current), (1193, 2047));
    // Values of the pages: stall torque, stall current and a step of current.
    let nm_a = |model: table::Model, step_a: f32| model.torque_step_nm / step_a;
    for (model, number, nm, a, step_a) in [
        (table::XL330_M077, 1190, 0.215, 1.47, 1.0e-3),
        (table::XL330_M288, 1200, 0.52, 1.47, 1.0e-3),
        (table::XM430_W350, 1020, 4.1, 2.3, 2.69e-3),
        (table::XM540_W270, 1120, 10.6, 4.4, 2.69e-3),
        (table::XH430_W210, 1010, 2.5, 1.3, 2.69e-3),
        (table::XH430_W350, 1000, 3.4, 1.3, 2.69e-3),
        (table::XH540_W150, 1110, 7.1, 4.9, 2.69e-3),
        (table::XH540_W270, 1100, 9.9, 4.9, 2.69e-3),
    ] {
        assert_eq!(model.number, number, "{}", model.name);
        assert!((nm_a(model, step_a) - nm / a).abs() < 1e-5 * nm / a, "{}", model.name);
        assert!(model.has_current(), "{}", model.name);
    }
    let mut numbers = table::MODELS.map(|model| model.number);
    numbers.sort();
    assert!(numbers.windows(2).all(|two| two[0] < two[1]));
    let addresses = [
        (table::OPERATING_MODE, 11),
        (table::TORQUE_ENABLE, 64),
        (table::HARDWARE_ERROR, 70),
        (table::POSITION_D_GAIN, 80),
        (table::BUS_WATCHDOG, 98),
        (table::GOAL_PWM, 100),
        (table::GOAL_CURRENT, 102),
        (table::GOAL_VELOCITY, 104),
        (table::PROFILE_VELOCITY, 112),
        (table::GOAL_POSITION, 116),
        (table::PRESENT_CURRENT, 126),
        (table::PRESENT_VELOCITY, 128),
        (table::PRESENT_POSITION, 132),
        (table::PRESENT_INPUT_VOLTAGE, 144),
        (table::PRESENT_TEMPERATURE, 146),
    ];
    assert!(addresses.iter().all(|(ours, theirs)| ours == theirs));
}

#[test]
fn units() {
    let position = |rad| SERVOS.goal_position(rad).map(i32::from_le_bytes);
    assert_eq!(
        (position(0.0), position(FRAC_PI_2), position(-PI)),
        (Some(2048), Some(3072), Some(0))
    );
    assert_eq!((position(f32::NAN), position(1e9)), (None, None));
    // "If '50' is written ...": 50 steps of 0.229 rev/min are 11.45 rev/min.
    let velocity = |rpm: f32| SERVOS.goal_velocity(rpm * PI / 30.0).map(i32::from_le_bytes);
    assert_eq!((velocity(11.45), velocity(-11.45), velocity(0.0)), (Some(50), Some(-50), Some(0)));
    // 330 steps are 75.57 rev/min.
    assert_eq!((velocity(75.6), velocity(75.8)), (Some(330), None));
    let current = |nm| SERVOS.goal_current(nm).map(i16::from_le_bytes);
    // 1 A is 371.7 steps of 2.69 mA.
    assert_eq!(current(3.0 / 2.3), Some(372));
    assert_eq!(current(100.0), None);
    assert_eq!(goal_pwm(0.5), Some(442i16.to_le_bytes()));
    assert_eq!((goal_pwm(1.0), goal_pwm(1.01)), (Some(885i16.to_le_bytes()), None));
    assert_eq!(position_gains(800, 1, 2), Some([2, 0, 1, 0, 0x20, 3]));
    assert_eq!(position_gains(16_384, 0, 0), None);
}

fn written(orders: &[ActuatorCommand]) -> Vec<(u16, Vec<u8>)> {
    let mut writes = Vec::new();
    SERVOS
        .encode(orders, &mut |packet| {
            let message = framed(&packet).pop().unwrap();
            assert_eq!(message.id, BROADCAST);
            let (address, rest) = message.parameters.split_at(2);
            writes.push((u16::from_le_bytes([address[0], address[1]]), rest[2..].to_vec()));
        })
        .unwrap();
    writes
}

/// The goal is the measured pose before torque is on. An expired watchdog is cleared before goals are written, since they
/// cannot be written while it reads −1.
#[test]
fn enabling_writes_in_order() {
    let enable =
        |id, measured_rad| ActuatorCommand { id, command: Command::EnableJoint { measured_rad } };
    let orders = [enable(1, 0.0), ActuatorCommand { id: 2, command: Command::EnableWheel }];
    assert_eq!(
        written(&orders),
        [
            (98, vec![1, 0, 2, 0]),
            (116, vec![1, 0, 8, 0, 0]),
            (104, vec![2, 0, 0, 0, 0]),
            (64, vec![1, 1, 2, 1]),
            (98, vec![1, 5, 2, 5]),
        ]
    );
    let current = |command| written(&[ActuatorCommand { id: 1, command }]);
    assert_eq!(current(Command::EnableTorque)[1], (102, vec![1, 0, 0]));
    // 372 steps of 2.69 mA are 1 A.
    let one_amp = Command::Torque { torque_nm: -3.0 / 2.3 };
    assert_eq!(current(one_amp), [(102, vec![1, 0x8C, 0xFE])]);
}

/// Servos without a current sensor lack a goal current, report a load instead of the current, and accept no torque.
#[test]
fn a_servo_without_a_current_sensor() {
    let servos = Dynamixel { model: table::XL430_W250, ..SERVOS };
    let limits = Command::Limits { speed_rad_s: 3.0, torque_nm: 1.0 };
    assert_eq!(servos.capabilities().limits, UpdatePolicy::Never);
    for command in [limits, Command::EnableTorque, Command::Torque { torque_nm: 0.1 }] {
        let order = ActuatorCommand { id: 1, command };
        assert_eq!(servos.check(&order), Err(Refusal::Unsupported("torque")));
    }
    // 50.0 % of 1.4 N·m.
    let data = [0, 0xF4, 1, 0, 0, 0, 0, 0, 8, 0, 0];
    let answer = framed(&packet(3, STATUS, &data).unwrap()).pop().unwrap();
    let torque_nm = servos.decode(&answer).unwrap().1.torque_nm.unwrap();
    assert!((torque_nm - 0.7).abs() < 1e-6, "{torque_nm}");
}

#[test]
fn one_packet_for_all_servos() {
    let go = |id| ActuatorCommand { id, command: Command::Joint(joint(0.0, 0.0, 0.0, None)) };
    let mut orders: Vec<ActuatorCommand> = (0..16).map(go).collect();
    let mut packets = Vec::new();
    SERVOS.encode(&orders, &mut |packet| packets.push(packet)).unwrap();
    // Length 14 + N (1 + L).
    assert_eq!((packets.len(), packets[0].len()), (1, 14 + 16 * 5));
    orders = (0..60).map(go).collect();
    packets.clear();
    SERVOS.encode(&orders, &mut |packet| packets.push(packet)).unwrap();
    assert_eq!(packets.len(), 3);
    let query = |id| ActuatorCommand { id, command: Command::Query };
    let mixed = [go(1), query(2), ActuatorCommand { id: 3, command: Command::Disable }, query(4)];
    assert_eq!(written(&mixed), [(64, vec![3, 0]), (116, vec![1, 0, 8, 0, 0]), (126, vec![2, 4])]);
    let limits = Command::Limits { speed_rad_s: 1.0, torque_nm: 1.0 };
    let addresses: Vec<u16> = written(&[ActuatorCommand { id: 1, command: limits }])
        .iter()
        .map(|write| write.0)
        .collect();
    assert_eq!(addresses, [102, 112]);
    assert!(matches!(sent(&SERVOS, 253, Command::Disable), Err(Refusal::Address)));
    let damped = joint(0.0, 0.0, 0.0, Some((0.0, 1.0)));
    assert_eq!(sent(&SERVOS, 1, Command::Joint(damped)), Err(Refusal::Unsupported("gains")));
    let limited = wheel(1.0, None, Some(1.0));
    assert!(sent(&SERVOS, 1, Command::Wheel(limited)).is_err());
}

#[test]
fn measurements() {
    let mut data = vec![0];
    data.extend((-100i16).to_le_bytes());
    data.extend(50i32.to_le_bytes());
    data.extend(1024i32.to_le_bytes());
    let answer = framed(&packet(9, STATUS, &data).unwrap()).pop().unwrap();
    let (id, told) = SERVOS.decode(&answer).unwrap();
    let near = |told: Option<f32>, meant: f32| (told.unwrap() - meant).abs() < 1e-5;
    assert_eq!(id, 9);
    assert!(near(told.position_rad, -FRAC_PI_2) && near(told.speed_rad_s, 11.45 * PI / 30.0));
    assert!(near(told.torque_nm, -0.269 * 3.0 / 2.3));
    assert_eq!((told.temperature_c, told.voltage_v), (None, None));
}

/// Voltage and temperature are read from 144 up, also on a line with fast reads, whose parts have another size.
#[test]
fn readings() {
    let query = |id| ActuatorCommand { id, command: Command::QueryReadings };
    for servos in [SERVOS, Dynamixel { reads_fast: true, ..SERVOS }] {
        let mut sent = Vec::new();
        servos.encode(&[query(3), query(5)], &mut |packet| sent.push(packet)).unwrap();
        assert_eq!(sent, [sync_read(144, 3, &[3, 5]).unwrap()]);
        let mut line = ReceiveBuffer::default();
        let bytes = packet(3, STATUS, &[0, 119, 0, 41]).unwrap();
        bytes.iter().for_each(|&byte| servos.receive(&mut line, byte, true));
        let Some(Answer::Actuator(3, told)) = servos.take(&mut line, false) else {
            panic!("an answer")
        };
        assert!((told.voltage_v.unwrap() - 11.9).abs() < 1e-5, "{told:?}");
        assert_eq!((told.temperature_c, told.position_rad), (Some(41.0), None));
        assert_eq!(told.faults, Some(Faults::NONE));
    }
}

/// Number of positions at which a packet with a valid CRC begins; packets may overlap.
fn whole_packets(stream: &[u8]) -> usize {
    let whole = |at: &usize| match stream[*at..] {
        [0xFF, 0xFF, 0xFD, 0, _, low, high, ..] => {
            let length = usize::from(u16::from_le_bytes([low, high]));
            stream
                .get(*at..*at + 7 + length)
                .and_then(|packet| packet.split_last_chunk())
                .is_some_and(|(body, crc)| length > 2 && crc16(body) == u16::from_le_bytes(*crc))
        }
        _ => false,
    };
    (0..stream.len()).filter(whole).count()
}

/// A cut packet that becomes valid with the first byte of the next one counts as a packet, and uses up that byte.
#[test]
fn a_header_can_end_a_cut_packet() {
    let ends_like_a_header = (0..=u16::MAX)
        .map(|parameter| packet(1, STATUS, &parameter.to_le_bytes()).unwrap())
        .find(|whole| whole.ends_with(&[0xFF]))
        .unwrap();
    let next = packet(2, STATUS, &[]).unwrap();
    let cut = &ends_like_a_header[..ends_like_a_header.len() - 1];
    let ids = |stream: &[u8]| framed(stream).iter().map(|m| m.id).collect::<Vec<_>>();
    assert_eq!(ids(&[cut, &next, &next].concat()), [1, 2]);
}

fn parameters() -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![3 => Just(0xFF), 2 => Just(0xFD), 1 => Just(0), 1 => any::<u8>()];
    proptest::collection::vec(byte, 0..180)
}

fn garbage() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..20),
        Just(HEADER.to_vec()),
        (any::<u8>(), any::<u16>())
            .prop_map(|(id, length)| { [&HEADER[..], &[id], &length.to_le_bytes()].concat() }),
        parameters().prop_flat_map(|p| {
            let whole = packet(1, WRITE, &p).unwrap().to_vec();
            (0..whole.len()).prop_map(move |cut| whole[..cut].to_vec())
        }),
    ];
    proptest::collection::vec(piece, 0..4).prop_map(|pieces| pieces.concat())
}

proptest! {
    #[test]
    fn packets_come_back(id in 0u8..=252, instruction: u8, parameters in parameters()) {
        let whole = packet(id, instruction, &parameters).unwrap();
        // Only the first header is a header.
        prop_assert!(!whole[4..whole.len() - 2].windows(4).any(|four| four == HEADER));
        let found = framed(&whole);
        prop_assert_eq!(found.len(), 1);
        prop_assert_eq!((found[0].id, found[0].instruction), (id, instruction));
        prop_assert_eq!(&found[0].parameters[..], &parameters[..]);
    }

    /// Packets survive any garbage between them, including cut packets and false headers with any length. One case is excluded:
    /// a cut packet that lacks a final 0xFF in its CRC is completed by the next header, whose packet is then lost.
    #[test]
    fn packets_survive_garbage(pieces in proptest::collection::vec((garbage(), 0u8..=252, parameters()), 1..4)) {
        let mut stream = Vec::new();
        for (garbage, id, parameters) in &pieces {
            stream.extend(garbage);
            stream.extend(packet(*id, STATUS, parameters).unwrap());
        }
        prop_assume!(whole_packets(&stream) == pieces.len());
        let mut found = framed(&stream).into_iter();
        for (_, id, parameters) in &pieces {
            prop_assert!(found.any(|m| m.id == *id && m.instruction == STATUS && m.parameters == parameters[..]));
        }
    }

    /// The receiver drops a packet with a single wrong bit at any position.
    #[test]
    fn a_wrong_bit_is_noticed(id in 0u8..=252, parameters in proptest::collection::vec(any::<u8>(), 0..30), at: prop::sample::Index) {
        let mut whole = packet(id, STATUS, &parameters).unwrap();
        let bit = at.index(whole.len() * 8);
        whole[bit / 8] ^= 1 << (bit % 8);
        let ours = framed(&whole).into_iter().filter(|m| m.instruction == STATUS && m.id == id && m.parameters == parameters[..]);
        prop_assert_eq!(ours.count(), 0);
    }

    #[test]
    fn any_bytes_do(stream in proptest::collection::vec(prop_oneof![Just(0xFF), Just(0xFD), Just(0), any::<u8>()], 0..2 * MAX_PACKET), taken: bool) {
        let mut deframer = ReceiveBuffer::default();
        for byte in stream {
            deframer.push(byte);
            if taken && let Some(message) = take(&mut deframer, false) {
                let _ = SERVOS.decode(&message);
            }
        }
        while take(&mut deframer, true).is_some() {}
    }

    /// Compares the CRC with a second algorithm, bit by bit from the definition of the polynomial.
    #[test]
    fn crc16_is_the_remainder(data in proptest::collection::vec(any::<u8>(), 0..40)) {
        let bitwise = data.iter().fold(0u16, |crc, &byte| {
            (0..8).fold(crc ^ u16::from(byte) << 8, |crc, _| {
                if crc & 0x8000 != 0 { crc << 1 ^ 0x8005 } else { crc << 1 }
            })
        });
        prop_assert_eq!(crc16(&data), bitwise);
    }
}
