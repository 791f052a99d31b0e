//! Fuzz target for ISO-TP: one end that receives arbitrary frames, and two ends over a bus that loses, repeats and swaps
//! frames.
//!
//! The single end must stay within its buffer, and work again once the noise is over. The two ends must deliver a message
//! unchanged or report an error.

use arbitrary::{Result, Unstructured};
use rollwalk_protocol::wire::isotp::{Endpoint, Event, Output, Timing};

const ROOM: usize = 100;
type End = Endpoint<ROOM>;

/// Time after which every timeout of the protocol has expired, µs.
const AGES_US: u64 = 3_600_000_000;
const TIMEOUT_US: u64 = 1_000_000;

/// Effect of the bus on a frame.
#[derive(Clone, Copy, PartialEq)]
enum BusEffect {
    Carried,
    Lost,
    Repeated,
    /// Delivered after the next frame.
    Held,
}

impl BusEffect {
    fn of(byte: u8) -> Self {
        match byte {
            0 => BusEffect::Lost,
            1 => BusEffect::Repeated,
            2 => BusEffect::Held,
            _ => BusEffect::Carried,
        }
    }
}

fn end(u: &mut Unstructured<'_>) -> Result<End> {
    let (block_size, st_min) = u.arbitrary()?;
    Ok(End::new(Timing { block_size, st_min, timeout_us: TIMEOUT_US }))
}

/// Message of `len` bytes; byte `i` is `first + i`.
fn message(len: usize, first: u8) -> Vec<u8> {
    (0..len).map(|i| first.wrapping_add(i as u8)).collect()
}

/// Sends `message` over a bus with the effects of `fate`, until no frame moves any more. Returns true if the message arrived.
fn carry(
    from: &mut End,
    to: &mut End,
    now_us: &mut u64,
    message: &[u8],
    mut fate: impl FnMut() -> BusEffect,
) -> bool {
    from.send(message).expect("idle, and it has room");
    let mut received = false;
    // From `from` to `to`, and back.
    let mut held: [Option<Vec<u8>>; 2] = [None, None];
    // A frame needs at most two turns, and waits at most for the longest separation or timeout.
    for _ in 0..40 * message.len() + 400 {
        let mut moved = false;
        for back in [false, true] {
            let sender = if back { &mut *to } else { &mut *from };
            let Output::Send(pdu) = sender.poll(*now_us) else { continue };
            moved = true;
            let data = pdu.data().to_vec();
            assert!((1..=8).contains(&data.len()));
            let late = held[usize::from(back)].take();
            let now = match fate() {
                BusEffect::Carried => vec![data],
                BusEffect::Lost => vec![],
                BusEffect::Repeated => vec![data.clone(), data],
                BusEffect::Held => {
                    held[usize::from(back)] = Some(data);
                    vec![]
                }
            };
            for data in now.into_iter().chain(late) {
                let taker = if back { &mut *from } else { &mut *to };
                if taker.on_frame(&data, *now_us) == Event::Received {
                    assert!(!back && taker.received() == message, "another message");
                    received = true;
                }
            }
        }
        if !moved {
            if !from.is_sending() {
                break;
            }
            *now_us += 127_000;
        }
    }
    assert!(!from.is_sending(), "hangs");
    received
}

fn hostile(u: &mut Unstructured<'_>) -> Result<()> {
    let mut us = end(u)?;
    let mut now_us = 0u64;
    while !u.is_empty() {
        let what = u.arbitrary::<u8>()?;
        match what % 8 {
            0..=3 => {
                let len = usize::from(what >> 4).min(u.len());
                let event = us.on_frame(u.bytes(len)?, now_us);
                let received = us.received();
                assert!(received.len() <= ROOM);
                assert!(event != Event::Received || !received.is_empty());
            }
            4 => {
                let _ = us.send(&message(usize::from(u.arbitrary::<u8>()?), what));
            }
            5 => now_us = now_us.saturating_add(u64::from(u.arbitrary::<u32>()?)),
            // Even a clock that runs backwards does no harm.
            6 => now_us = u64::from(u.arbitrary::<u32>()?),
            _ => {
                let mut polls = 0;
                while us.poll(now_us) != Output::Idle {
                    polls += 1;
                    // A failure, a flow control, and a message without separation.
                    assert!(polls <= 4 + ROOM / 7, "does not stop sending");
                }
            }
        }
    }
    // The noise has ended: a message in progress completes, a message that waits times out, and a new message passes in both
    // directions.
    for _ in 0..=2 * ROOM {
        now_us = now_us.saturating_add(AGES_US);
        while us.poll(now_us) != Output::Idle {}
    }
    let mut peer = End::new(Timing::default());
    let text = message(ROOM, 1);
    assert!(carry(&mut us, &mut peer, &mut now_us, &text, || BusEffect::Carried));
    assert!(carry(&mut peer, &mut us, &mut now_us, &text, || BusEffect::Carried));
    Ok(())
}

fn bad_bus(u: &mut Unstructured<'_>) -> Result<()> {
    let (mut a, mut b) = (end(u)?, end(u)?);
    let mut now_us = 0;
    while !u.is_empty() {
        let (len, first) = u.arbitrary::<(u8, u8)>()?;
        let text = message(usize::from(len) % ROOM + 1, first);
        let mut fates = u.bytes(16.min(u.len()))?.iter();
        let mut sound = true;
        let received = carry(&mut a, &mut b, &mut now_us, &text, || {
            let fate = fates.next().map_or(BusEffect::Carried, |&byte| BusEffect::of(byte));
            sound &= fate == BusEffect::Carried;
            fate
        });
        assert!(received || !sound, "a sound bus lost a message");
        now_us += 2 * TIMEOUT_US;
        while b.poll(now_us) != Output::Idle {}
    }
    Ok(())
}

/// Runs an end with forged frames, or two ends with a bad bus between them.
pub fn run(data: &[u8]) {
    let Some((&how, rest)) = data.split_first() else { return };
    let mut u = Unstructured::new(rest);
    let played = if how % 2 == 0 { hostile(&mut u) } else { bad_bus(&mut u) };
    // An error means that the input is too short.
    let _ = played;
}

/// Seeds with a conversation of each sort.
pub fn seeds() -> Vec<Vec<u8>> {
    let single = [0x40, 3, 1, 2, 3, 7];
    let first = [0x80, 0x10, 20, 1, 2, 3, 4, 5, 6, 7];
    let next = [0x80, 0x21, 7, 8, 9, 10, 11, 12, 13, 0x80, 0x22, 14, 15, 16, 17, 18, 19, 20];
    let sending = [4, 50, 7, 0x30, 0x30, 2, 5, 7, 5, 0, 0, 1, 0, 7];
    let hostile = [&[0, 2, 5][..], &single, &first, &next, &sending].concat();
    let bus = |fates: [u8; 16]| [&[1, 0, 0, 2, 5, 99, 1][..], &fates, &[30, 9]].concat();
    let mut losing = [9; 16];
    losing[3] = 0;
    let mut repeating = [9; 16];
    repeating[4] = 1;
    let mut swapping = [9; 16];
    swapping[5] = 2;
    vec![hostile, bus([9; 16]), bus(losing), bus(repeating), bus(swapping)]
}
