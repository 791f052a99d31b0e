//! Fuzz target for every actuator protocol. Any order is encoded to frames or refused. Any frame is decoded to finite values or
//! ignored. Values that are sent can be decoded again.

use arbitrary::{Arbitrary, Result, Unstructured};
use rollwalk_protocol::actuator;
use rollwalk_protocol::actuators::bus::Protocol;
use rollwalk_protocol::actuators::cybergear::{CyberGear, SAMPLE_MAX_RAD, TABLE_MAX_RAD};
use rollwalk_protocol::actuators::dynamixel::Dynamixel;
use rollwalk_protocol::actuators::dynamixel::packet::{ReceivedPacket, next, take};
use rollwalk_protocol::actuators::dynamixel::table::XM540_W150;
use rollwalk_protocol::actuators::feetech::{self, Feetech};
use rollwalk_protocol::actuators::maestro::{Maestro, Pulse};
use rollwalk_protocol::actuators::mit::{AnswerId, Codes, MODELS, Mit};
use rollwalk_protocol::actuators::odrive::{Odrive, Version};
use rollwalk_protocol::actuators::rollwalk::Rollwalk;
use rollwalk_protocol::actuators::serial::ReceiveBuffer;
use rollwalk_protocol::actuators::{
    ActuatorCommand, CanCodec, Codec, Command, Feedback, Gains, JointSetpoint, Packet, Refusal,
    WheelSetpoint,
};
use rollwalk_protocol::can::Frame;

/// Protocols with settings from the input.
struct ProtocolSet {
    mit: Mit,
    odrive: Odrive,
    cybergear: CyberGear,
    dynamixel: Dynamixel,
    feetech: Feetech,
    maestro: Maestro,
}

impl<'a> Arbitrary<'a> for ProtocolSet {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        let master = if u.arbitrary()? { AnswerId::Own } else { AnswerId::Master(u.arbitrary()?) };
        let version = if u.arbitrary()? { Version::V05 } else { Version::V06 };
        let max_position_rad = if u.arbitrary()? { TABLE_MAX_RAD } else { SAMPLE_MAX_RAD };
        Ok(Self {
            mit: Mit { model: *u.choose(&MODELS)?, answers_from: master },
            odrive: Odrive {
                version,
                reduction: number(u)?,
                torque_constant_nm_a: number(u)?,
                estimates_hz: u.arbitrary()?,
            },
            cybergear: CyberGear { host: u.arbitrary()?, max_position_rad },
            dynamixel: Dynamixel {
                model: XM540_W150,
                watchdog_20ms: u.arbitrary()?,
                return_delay_us: u.arbitrary()?,
                reads_fast: u.arbitrary()?,
            },
            feetech: Feetech {
                model: *u.choose(&feetech::table::MODELS)?,
                return_delay_us: u.arbitrary()?,
            },
            maestro: Maestro {
                device: u.arbitrary()?,
                crc: u.arbitrary()?,
                set_multiple: u.arbitrary()?,
                pulse: Pulse {
                    centre_us: number(u)?,
                    us_per_rad: number(u)?,
                    limits_us: (number(u)?, number(u)?),
                },
            },
        })
    }
}

/// Practical value, or any 32 bits.
fn number(u: &mut Unstructured<'_>) -> Result<f32> {
    Ok(if u.arbitrary::<u8>()? & 3 > 0 {
        f32::from(u.arbitrary::<i16>()?) / 256.0
    } else {
        f32::from_bits(u.arbitrary()?)
    })
}

fn command(u: &mut Unstructured<'_>) -> Result<Command> {
    let gains = |u: &mut Unstructured<'_>| -> Result<Gains> {
        Ok(Gains { kp_nm_rad: number(u)?, kd_nm_s_rad: number(u)? })
    };
    let maybe = |u: &mut Unstructured<'_>| -> Result<Option<f32>> {
        Ok(if u.arbitrary()? { Some(number(u)?) } else { None })
    };
    Ok(match u.arbitrary::<u8>()? % 11 {
        0 => Command::Disable,
        1 => Command::EnableJoint { measured_rad: number(u)? },
        2 => Command::EnableWheel,
        3 => Command::Query,
        4 => Command::ClearFaults,
        5 => Command::Gains(gains(u)?),
        6 => Command::Limits { speed_rad_s: number(u)?, torque_nm: number(u)? },
        7 => Command::Wheel(WheelSetpoint {
            speed_rad_s: number(u)?,
            torque_nm: if u.arbitrary()? { number(u)? } else { 0.0 },
            kd_nm_s_rad: maybe(u)?,
            torque_limit_nm: maybe(u)?,
        }),
        8 => Command::QueryReadings,
        _ => Command::Joint(JointSetpoint {
            position_rad: number(u)?,
            speed_rad_s: number(u)?,
            torque_nm: if u.arbitrary()? { number(u)? } else { 0.0 },
            gains: if u.arbitrary()? { Some(gains(u)?) } else { None },
        }),
    })
}

/// Checks that every value is finite.
fn assert_finite(told: Option<(u8, Feedback)>) {
    if let Some((_, f)) = told {
        let all = [f.position_rad, f.speed_rad_s, f.torque_nm, f.temperature_c, f.voltage_v];
        assert!(all.into_iter().flatten().all(f32::is_finite), "{f:?}");
    }
}

/// Encodes orders one by one and all together; `look` receives every frame.
fn send<P: Codec>(
    protocol: &P,
    orders: &[ActuatorCommand],
    bits: fn(&P::Sent) -> u32,
    mut look: impl FnMut(&P::Sent),
) {
    let can = protocol.capabilities();
    let mut refused = None;
    for (i, order) in orders.iter().enumerate() {
        let mut count = 0;
        let result = protocol.emit(order, &mut |frame| {
            count += 1;
            look(&frame);
        });
        match result {
            Ok(()) => assert!(order.id <= can.max_id && (1..=4).contains(&count), "{order:?}"),
            Err(why) => {
                assert_eq!(count, 0, "refused, and sent all the same: {order:?}");
                assert!(why != Refusal::Address || order.id > can.max_id, "{order:?}");
                refused = refused.or(Some((i, why)));
            }
        }
    }
    let (mut count, mut sum) = (0, 0);
    let result = protocol.encode(orders, &mut |frame| {
        count += 1;
        sum += bits(&frame);
        look(&frame);
    });
    assert_eq!(result.err(), refused, "together as one by one");
    assert!(refused.is_none() || count == 0);
    // The traffic is computed for one set-point of each motor.
    let setpoints =
        |order: &ActuatorCommand| matches!(order.command, Command::Joint(_) | Command::Wheel(_));
    let mut ids: Vec<u8> = orders.iter().map(|order| order.id).collect();
    ids.sort_unstable();
    ids.dedup();
    if refused.is_none() && ids.len() == orders.len() && orders.iter().all(setpoints) {
        let reckoned = protocol.traffic(orders.len() as u32).bits_per_period;
        assert!(sum <= reckoned, "{sum} bits, {reckoned} were reckoned for {orders:?}");
    }
}

/// Encodes orders with example settings of a protocol. Orders that `check` accepts must be sent, refused ones must not.
fn send_example(orders: &[ActuatorCommand]) {
    let count = Protocol::examples().count();
    let Some(protocol) = Protocol::examples().nth(orders.len() % count) else { return };
    for order in orders {
        let mut sent = 0;
        let emitted = protocol.emit(order, &mut |_| sent += 1);
        let encoded = protocol.encode(&[*order], &mut |_| sent += 1).map_err(|(_, why)| why);
        let taken = emitted.and(encoded);
        assert_eq!(taken, protocol.check(order), "{protocol:?}");
        assert_eq!(taken.is_ok(), sent > 0, "{protocol:?} {order:?}");
    }
}

fn encode_commands(all: &ProtocolSet, orders: &[ActuatorCommand]) {
    send_example(orders);
    let hears = |frame: &Frame| {
        assert_finite(Rollwalk.decode(frame));
        assert_finite(all.mit.decode(frame));
        assert_finite(all.odrive.decode(frame));
    };
    send(&Rollwalk, orders, Frame::exact_bits, hears);
    send(&all.mit, orders, Frame::exact_bits, |frame| {
        // A set-point as codes, or a command.
        let codes =
            Codes::of(frame).map(|codes| codes.frame(frame.standard_id().unwrap_or(0) as u8));
        assert!(codes.is_none_or(|again| again == *frame));
        hears(frame);
    });
    send(&all.odrive, orders, Frame::exact_bits, hears);
    send(&all.cybergear, orders, Frame::exact_bits, |frame| {
        assert_finite(all.cybergear.decode(frame));
    });
    let serial = |packet: &Packet| 10 * packet.len() as u32;
    let mut line = ReceiveBuffer::default();
    send(&all.dynamixel, orders, serial, |packet| {
        packet.iter().for_each(|&byte| line.push(byte));
        let message = take(&mut line, false).expect("what we send is a packet");
        // Our own instructions, received again on a half-duplex line, are not answers.
        assert_eq!(all.dynamixel.decode(&message), None);
        assert_eq!(take(&mut line, false), None);
    });
    let mut line = ReceiveBuffer::default();
    send(&all.feetech, orders, serial, |packet| {
        packet.iter().for_each(|&byte| line.push(byte));
        assert_eq!(feetech::packet::take(&mut line, false), None, "none of ours is an answer");
        assert_eq!(line.bytes(), [], "and each is whole");
    });
    send(&all.maestro, orders, serial, |packet| {
        let (head, rest) = packet.split_first().expect("not empty");
        // The high bit marks the beginning of a command and nothing else.
        assert!(*head >= 0x80 && rest.iter().all(|&byte| byte < 0x80), "{packet:x?}");
    });
}

/// Checks that decoded frames of the Rollwalk profile encode to the same bytes again.
fn check_profile(frame: &Frame) {
    use actuator::{Control, Feedback, JointSetpoint, WheelSetpoint};
    if let Some((id, told)) = Control::decode(frame) {
        assert_eq!(told.encode(id).as_ref(), Some(frame));
    }
    if let Some((id, told)) = Feedback::decode(frame) {
        assert_eq!(told.encode(id).as_ref(), Some(frame));
    }
    if let Some((id, told)) = JointSetpoint::decode(frame) {
        assert_eq!(told.encode(id).as_ref(), Some(frame));
    }
    // At higher speeds, an f32 may differ by one step; see the golden test.
    if let Some((id, told)) = WheelSetpoint::decode(frame)
        && told.speed_rad_s.abs() < 419.0
    {
        assert_eq!(told.encode(id).as_ref(), Some(frame));
    }
}

fn decode_frame(all: &ProtocolSet, id: u32, data: &[u8]) {
    let frame = Frame::standard(id as u16 & 0x7FF, data).expect("11 bits and 8 bytes");
    check_profile(&frame);
    assert_finite(Rollwalk.decode(&frame));
    assert_finite(all.mit.decode(&frame));
    assert_finite(all.odrive.decode(&frame));
    let extended = Frame::extended(id & 0x1FFF_FFFF, data).expect("29 bits and 8 bytes");
    for protocol in Protocol::examples() {
        assert_finite(protocol.decode(&frame));
        assert_finite(protocol.decode(&extended));
    }
    assert_finite(all.cybergear.decode(&extended));
    let _ = all.cybergear.parameter(&extended);
    if let Ok(answer) = data.try_into() {
        let _ = Maestro::errors(answer);
    }
}

fn play(u: &mut Unstructured<'_>) -> Result<()> {
    let all: ProtocolSet = u.arbitrary()?;
    let (mut line, mut other) = (ReceiveBuffer::default(), ReceiveBuffer::default());
    while !u.is_empty() {
        match u.arbitrary::<u8>()? % 4 {
            0 => {
                let mut orders = Vec::new();
                for _ in 0..u.arbitrary::<u8>()? % 32 {
                    orders.push(ActuatorCommand { id: u.arbitrary()?, command: command(u)? });
                }
                encode_commands(&all, &orders);
            }
            1 => {
                let id = u.arbitrary::<u8>()?;
                encode_commands(&all, &[ActuatorCommand { id, command: command(u)? }]);
            }
            2 => {
                let id = u.arbitrary::<u32>()?;
                let len = usize::from(u.arbitrary::<u8>()? % 9).min(u.len());
                decode_frame(&all, id, u.bytes(len)?);
            }
            _ => {
                let len = usize::from(u.arbitrary::<u8>()?).min(u.len());
                for &byte in u.bytes(len)? {
                    other.push(byte);
                    while let Some(answer) = feetech::packet::take(&mut other, byte == 0) {
                        assert_finite(Some(all.feetech.decode(&answer)));
                    }
                    line.push(byte);
                    while let Some(taken) = next(&mut line, byte == 0, all.dynamixel.reads_fast) {
                        assert_finite(match taken {
                            ReceivedPacket::Message(message) => all.dynamixel.decode(&message),
                            ReceivedPacket::Part(part) => Some(all.dynamixel.decode_part(&part)),
                        });
                    }
                }
            }
        }
    }
    let actuators = u.arbitrary()?;
    let _ = (all.mit.traffic(actuators), all.maestro.traffic(actuators));
    let _ = (all.odrive.traffic(actuators), all.cybergear.traffic(actuators));
    let _ = (all.dynamixel.traffic(actuators), all.feetech.traffic(actuators));
    let _ = Rollwalk.traffic(actuators);
    Ok(())
}

/// Runs orders, frames and bytes of a line from the input, with all protocols.
pub fn run(data: &[u8]) {
    // An error means that the input ended.
    let _ = play(&mut Unstructured::new(data));
}

/// Seeds with practical settings, and with the actuators' answers from their documents.
pub fn seeds() -> Vec<Vec<u8>> {
    let frame =
        |id: u32, data: &[u8]| [&[2][..], &id.to_le_bytes(), &[data.len() as u8], data].concat();
    let line = |bytes: &[u8]| [&[3, bytes.len() as u8][..], bytes].concat();
    let answers = [
        frame(0x185, &[0x88, 0x13, 0, 0, 0xC8, 0, 0x11, 7]),
        frame(0x105, &[0x78, 0xEC, 0xE8, 3, 0xD0, 7, 0xF4, 1]),
        frame(0x205, &[0x08, 0xDB, 0xFE, 0xFF, 0xC8, 0, 0xC8, 0]),
        frame(0, &[1, 0x80, 0, 0x80, 8, 0, 0x28, 0]),
        frame(0x029, &[0, 0, 0x80, 0x3F, 0, 0, 0, 0x40]),
        frame(0x021, &[0, 0, 0, 0, 8, 0, 0, 0]),
        frame(0x0280_01FD, &[0x80, 0, 0x80, 0, 0x80, 0, 1, 0x2C]),
        frame(0x1100_01FD, &[0x19, 0x70, 0, 0, 0, 0, 0x80, 0x3F]),
        frame(0, &[4, 0]),
    ];
    let status = rollwalk_protocol::actuators::dynamixel::packet::packet(1, 0x55, &[0; 11]);
    let settings = [1u8; 54];
    let orders: Vec<u8> = (0..=255).flat_map(|i: u8| [1, i % 8, i, 1, i, 0]).collect();
    vec![
        [&settings[..], &answers.concat()].concat(),
        [&settings[..], &line(&status.expect("short"))].concat(),
        // The manual's answer to example 8.
        [&settings[..], &line(&[0xFF, 0xFF, 1, 10, 0, 0, 8, 0, 0, 0, 0, 0x79, 0x1E, 0x55])]
            .concat(),
        [&settings[..], &orders].concat(),
        orders,
    ]
}
