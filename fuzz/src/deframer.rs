//! Packets on a serial line among noise: what is taken was there, and after silence a sound packet is
//! found whatever came before it.

use rollwalk_protocol::actuators::dynamixel::packet::{Deframer, Message, packet};

/// Longest of what a packet may hold: see `packet`.
const MAX_PARAMETERS: usize = 180;

fn take_all(deframer: &mut Deframer, silence: bool, into: &mut Vec<Message>) {
    let next = |d: &mut Deframer| if silence { d.take_after_silence() } else { d.take() };
    while let Some(message) = next(deframer) {
        into.push(message);
    }
}

fn dynamixel(line: &[u8], parameters: &[u8]) {
    let mut deframer = Deframer::default();
    let mut taken = Vec::new();
    for &byte in line {
        deframer.push(byte);
        take_all(&mut deframer, false, &mut taken);
    }
    take_all(&mut deframer, true, &mut taken);
    // Ten bytes each, none used twice.
    assert!(taken.len() <= line.len() / 10);
    let mut from = 0;
    for message in &taken {
        // Addresses that we do not speak to may still be heard.
        let Some(bytes) = packet(message.id, message.instruction, &message.parameters) else {
            continue;
        };
        let found = line[from..].windows(bytes.len()).position(|window| window == &bytes[..]);
        from += found.expect("what was taken was on the line") + bytes.len();
    }

    let sound = packet(7, 0x55, parameters).expect("short enough");
    for &byte in &sound {
        deframer.push(byte);
    }
    let message = deframer.take().expect("after silence, a packet is a packet");
    assert_eq!((message.id, message.instruction), (7, 0x55));
    assert_eq!(&message.parameters[..], parameters);
    assert_eq!(deframer.take(), None);
}

/// The first byte says how much of the rest is the sound packet.
pub fn run(data: &[u8]) {
    let Some((&len, rest)) = data.split_first() else { return };
    let (parameters, line) = rest.split_at(usize::from(len).min(rest.len()).min(MAX_PARAMETERS));
    dynamixel(line, parameters);
}

/// Packets whole, stuffed, cut short, and one within another.
pub fn seeds() -> Vec<Vec<u8>> {
    let one = packet(1, 0x55, &[0, 1, 2, 3]).expect("short");
    let stuffed = packet(2, 0x83, &[0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFD, 0xFD]).expect("short");
    let nested = packet(3, 0x55, &one).expect("short");
    let long = packet(4, 0x55, &[0xAB; MAX_PARAMETERS]).expect("fits");
    let seed = |line: &[&[u8]]| [&[4, 0xFF, 0xFF, 0xFD, 0][..], &line.concat()].concat();
    vec![
        seed(&[&one, &stuffed, &one]),
        seed(&[&one[..6], &one]),
        seed(&[&[0xFF, 0xFF], &nested, &stuffed[..9], &one]),
        seed(&[&nested[..nested.len() - 1], &one]),
        seed(&[&long, &one]),
    ]
}
