//! Fuzz target for packets among noise on serial lines: of Dynamixel servos, of the line to an emulated board, and of the link.
//! Every extracted packet was on the line. A valid packet is found after any noise.

use rollwalk_protocol::actuators::dynamixel::packet::{Message, packet, take};
use rollwalk_protocol::actuators::serial::ReceiveBuffer;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{self, BoardReport, Gateway, Packet};
use rollwalk_protocol::tunnel::{self, Answer, Buses, Hello, Input, Request, Step, StepResult};
use rollwalk_protocol::wire::Node;
use rollwalk_protocol::wire::isotp::{Output, Timing};
use rollwalk_protocol::wire::transport::{Endpoint, frame_to_host};

/// Node of the messages: `0x510` is sent to it, `0x511` by it.
const NODE: Node = Node::new(1).unwrap();

/// Maximum number of parameters of a packet; see `packet`.
const MAX_PARAMETERS: usize = 180;

fn take_all(buffer: &mut ReceiveBuffer, is_silent: bool, into: &mut Vec<Message>) {
    while let Some(message) = take(buffer, is_silent) {
        into.push(message);
    }
}

fn dynamixel(line: &[u8], parameters: &[u8]) {
    let mut buffer = ReceiveBuffer::default();
    let mut taken = Vec::new();
    for &byte in line {
        buffer.push(byte);
        take_all(&mut buffer, false, &mut taken);
    }
    take_all(&mut buffer, true, &mut taken);
    // Ten bytes each, and no byte is used twice.
    assert!(taken.len() <= line.len() / 10);
    let mut from = 0;
    for message in &taken {
        // Packets of addresses that are not ours may still be received.
        let Some(bytes) = packet(message.id, message.instruction, &message.parameters) else {
            continue;
        };
        let found = line[from..].windows(bytes.len()).position(|window| window == &bytes[..]);
        from += found.expect("what was taken was on the line") + bytes.len();
    }

    let sound = packet(7, 0x55, parameters).expect("short enough");
    for &byte in &sound {
        buffer.push(byte);
    }
    let message = take(&mut buffer, false).expect("after silence, a packet is a packet");
    assert_eq!((message.id, message.instruction), (7, 0x55));
    assert_eq!(&message.parameters[..], parameters);
    assert_eq!(take(&mut buffer, false), None);
}

/// Checks that a decoded request or answer encodes to bytes that decode to an equal value.
fn check_packet(packet: &[u8]) {
    let again = |line: Option<tunnel::Line>| {
        let line = line.expect("what was decoded fits");
        let mut deframer = tunnel::Deframer::default();
        let (&zero, rest) = line.split_last().expect("not empty");
        assert!(zero == 0 && !rest.contains(&0), "zero ends a packet and is nowhere else");
        assert!(rest.iter().all(|&byte| deframer.push(byte).is_none()));
        deframer.push(0).expect("a sound packet").to_vec()
    };
    if let Some((sequence, request)) = Request::decode(packet) {
        assert_eq!(again(request.encode(sequence)), packet, "{request:?}");
    }
    if let Some((sequence, answer)) = Answer::decode(packet) {
        // A frame may occur twice, and buses in any order. Then the encoded answer is shorter.
        let bytes = again(answer.encode(sequence));
        let (_, told) = Answer::decode(&bytes).expect("our own");
        assert_eq!(told.encode(sequence), answer.encode(sequence));
        assert!(bytes == packet || matches!(answer, Answer::Stepped(_)), "{answer:?}");
    }
}

fn board(line: &[u8], body: &[u8]) {
    let mut deframer = tunnel::Deframer::default();
    let mut taken = 0;
    for &byte in line {
        if let Some(packet) = deframer.push(byte) {
            taken += 1;
            check_packet(packet);
        }
    }
    // Each has a checksum, stuffing and a zero.
    assert!(taken <= line.len() / 6);
    check_packet(body);

    deframer.push(0);
    let hello = Request::Hello.encode(9).expect("short");
    let found: Vec<_> =
        hello.iter().filter_map(|&byte| deframer.push(byte).map(Request::decode)).collect();
    assert_eq!(found, [Some((9, Request::Hello))], "after a zero, a packet is a packet");
}

/// Checks that decoded packets encode to the same bytes. Whatever the line ends with, the next message must arrive.
fn link(line: &[u8], message: &[u8]) {
    let mut deframer = serial::Deframer::default();
    let mut gateway = Gateway::default();
    for &byte in line {
        let Some(body) = deframer.push(byte) else { continue };
        let Some(packet) = Packet::decode(body) else { continue };
        let again = packet.encode().expect("what was decoded fits");
        let mut other = serial::Deframer::default();
        let again: Vec<_> =
            again.iter().filter_map(|&b| other.push(b).map(<[u8]>::to_vec)).collect();
        assert_eq!(again, [body]);
        match packet {
            Packet::Link(frame) => {
                if let Some(packet) = gateway.send(0, &frame) {
                    packet.encode().expect("what comes of frames fits");
                }
            }
            Packet::Message { id, bytes } => gateway.receive(id, bytes),
            Packet::Ask | Packet::Report(_) => {}
        }
        while gateway.poll(0).is_some() {}
    }
    if message.is_empty() {
        return;
    }
    gateway.receive(0x510, message);
    let mut controller = Endpoint::new(Timing::default());
    while let Some(frame) = gateway.poll(0) {
        assert_eq!(frame.standard_id(), Some(0x510));
        controller.on_frame(frame.data(), 0);
        while let Output::Send(flow_control) = controller.poll(0) {
            let frame = frame_to_host(NODE, &flow_control);
            assert_eq!(gateway.send(0, &frame), None, "the line carries messages whole");
        }
    }
    assert_eq!(controller.received(), message);
}

/// Runs the input. The first byte selects the line, the second the length of the valid packet in the rest.
pub fn run(data: &[u8]) {
    let Some((&[whose, len], rest)) = data.split_first_chunk() else { return };
    let (packet, line) = rest.split_at(usize::from(len).min(rest.len()).min(MAX_PARAMETERS));
    match whose % 3 {
        0 => dynamixel(line, packet),
        1 => board(line, packet),
        _ => link(line, packet),
    }
}

/// Seeds with packets that are complete, stuffed, cut short, or nested.
pub fn seeds() -> Vec<Vec<u8>> {
    let one = packet(1, 0x55, &[0, 1, 2, 3]).expect("short");
    let stuffed = packet(2, 0x83, &[0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFD, 0xFD]).expect("short");
    let nested = packet(3, 0x55, &one).expect("short");
    let long = packet(4, 0x55, &[0xAB; MAX_PARAMETERS]).expect("fits");
    let seed = |line: &[&[u8]]| [&[0, 4, 0xFF, 0xFF, 0xFD, 0][..], &line.concat()].concat();
    let mut seeds = vec![
        seed(&[&one, &stuffed, &one]),
        seed(&[&one[..6], &one]),
        seed(&[&[0xFF, 0xFF], &nested, &stuffed[..9], &one]),
        seed(&[&nested[..nested.len() - 1], &one]),
        seed(&[&long, &one]),
    ];
    let frame = Frame::standard(0x185, &[1, 2, 0, 0, 5, 6, 7, 8]).expect("a frame");
    let free = Buses::default().with_link().with_actuator(1);
    let step = |input| Request::Step(Step { now_us: 8333, input, free });
    let inputs =
        [None, Some(Input::Tick), Some(Input::Link(frame)), Some(Input::Actuator(1, frame))];
    let mut stepped =
        StepResult { playing: Some((3, 40, 0.5)), link: Some(frame), ..StepResult::default() };
    stepped.actuators[1] = Some(frame);
    let lines = inputs
        .into_iter()
        .filter_map(|input| step(input).encode(1))
        .chain(Request::Figures.encode(2))
        .chain(Answer::Stepped(stepped).encode(3))
        .chain(Answer::Hello(Hello { config_hash: 5, steps: 6 }).encode(4))
        .chain(Answer::Figures(Default::default()).encode(5));
    for line in lines {
        let mut deframer = tunnel::Deframer::default();
        let body = line.iter().find_map(|&byte| deframer.push(byte).map(<[u8]>::to_vec));
        let body = body.expect("a sound packet");
        seeds.push([&[1, body.len() as u8][..], &body, &line, &line[..3], &[0], &line].concat());
    }
    // A message, and the start of a segmented one, which no correct sender sends here.
    let first = Frame::standard(0x511, &[0x10, 20, 1, 2, 3, 4, 5, 6]).expect("a frame");
    let packets = [
        Packet::Link(frame),
        Packet::Link(first),
        Packet::Message { id: 0x510, bytes: &[0x11; 40] },
        Packet::Ask,
        Packet::Report(BoardReport::default()),
    ];
    let line: Vec<u8> = packets.iter().flat_map(|p| p.encode().expect("fits")).collect();
    seeds.push([&[2, 2, 0x12, 7][..], &line, &line[..30], &[0], &line].concat());
    // Then a message of many frames.
    seeds.push([&[2, 150][..], &[0x5A; 150], &line].concat());
    seeds
}
