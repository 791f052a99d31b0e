//! Tests of ISO-TP: golden sequences, and two ends over a bus that loses, repeats, reorders and damages frames.

use proptest::prelude::*;
use rollwalk_protocol::wire::isotp::{Endpoint, Event, IsoTpError, Output, SendError, Timing};

type End = Endpoint<600>;

fn end(block_size: u8, st_min: u8) -> End {
    End::new(Timing { block_size, st_min, timeout_us: 1_000_000 })
}

/// Next payload to send, as hexadecimal digits; `-` if there is none.
fn next<const N: usize>(end: &mut Endpoint<N>, now_us: u64) -> String {
    match end.poll(now_us) {
        Output::Idle => "-".into(),
        Output::Send(pdu) => pdu.data().iter().map(|b| format!("{b:02x}")).collect(),
        Output::Failed(error) => format!("{error:?}"),
    }
}

#[test]
fn a_short_message_is_one_frame() {
    let (mut a, mut b) = (end(0, 0), end(0, 0));
    a.send(b"abc").unwrap();
    assert_eq!(next(&mut a, 0), "03616263");
    assert_eq!(next(&mut a, 0), "-");
    assert!(!a.is_sending());
    assert_eq!(b.on_frame(b"\x03abc", 0), Event::Received);
    assert_eq!(b.received(), b"abc");
    assert_eq!(next(&mut b, 0), "-");
    // Padding is accepted.
    assert_eq!(b.on_frame(b"\x02xyPPPPP", 0), Event::Received);
    assert_eq!(b.received(), b"xy");
}

#[test]
fn a_long_message_in_blocks_of_two() {
    let (mut a, mut b) = (end(0, 0), end(2, 5));
    a.send(b"abcdefghijklmnopqrstuvwxyz012345").unwrap();
    assert_eq!(a.send(b"x"), Err(SendError::Busy));
    assert_eq!(next(&mut a, 0), "1020616263646566");
    assert_eq!(next(&mut a, 0), "-", "waits for flow control");
    assert_eq!(b.on_frame(b"\x10\x20abcdef", 0), Event::None);
    assert_eq!(next(&mut b, 0), "300205");
    assert_eq!(next(&mut b, 0), "-");
    assert_eq!(a.on_frame(&[0x30, 2, 5], 100), Event::None);
    assert_eq!(next(&mut a, 100), "216768696a6b6c6d");
    assert_eq!(next(&mut a, 5_099), "-", "5 ms between frames");
    assert_eq!(next(&mut a, 5_100), "226e6f7071727374");
    assert_eq!(next(&mut a, 99_000), "-", "waits for flow control");
    assert_eq!(b.on_frame(b"\x21ghijklm", 200), Event::None);
    assert_eq!(next(&mut b, 200), "-");
    assert_eq!(b.on_frame(b"\x22nopqrst", 300), Event::None);
    assert_eq!(next(&mut b, 300), "300205");
    assert_eq!(a.on_frame(&[0x31, 0, 0], 99_000), Event::None, "wait");
    assert_eq!(next(&mut a, 99_000), "-");
    assert_eq!(a.on_frame(&[0x30, 0, 0xF3], 100_000), Event::None);
    assert_eq!(next(&mut a, 100_000), "2375767778797a30");
    assert_eq!(next(&mut a, 100_299), "-", "300 us between frames");
    assert_eq!(next(&mut a, 100_300), "243132333435");
    assert!(!a.is_sending());
    assert_eq!(b.on_frame(b"\x23uvwxyz0", 400), Event::None);
    assert_eq!(b.received(), b"");
    assert_eq!(b.on_frame(b"\x2412345", 500), Event::Received);
    assert_eq!(b.received(), b"abcdefghijklmnopqrstuvwxyz012345");
}

#[test]
fn silence_ends_a_message() {
    let (mut a, mut b) = (end(0, 0), end(0, 0));
    a.send(&[1; 20]).unwrap();
    next(&mut a, 0);
    assert_eq!(next(&mut a, 1_000_000), "-");
    assert_eq!(next(&mut a, 1_000_001), "SendTimeout");
    assert!(!a.is_sending());
    b.on_frame(&[0x10, 20, 1, 1, 1, 1, 1, 1], 7);
    next(&mut b, 7);
    assert_eq!(next(&mut b, 1_000_008), "ReceiveTimeout");
    assert_eq!(b.on_frame(&[0x21, 1, 1, 1, 1, 1, 1, 1], 1_000_009), Event::None);
    assert_eq!(b.received(), b"");
}

#[test]
fn refusals() {
    let mut a = end(0, 0);
    a.send(&[1; 20]).unwrap();
    next(&mut a, 0);
    assert_eq!(a.on_frame(&[0x32, 0, 0], 0), Event::Failed(IsoTpError::PeerOverflow));
    a.send(&[1; 20]).unwrap();
    next(&mut a, 0);
    assert_eq!(a.on_frame(&[0x35, 0, 0], 0), Event::Failed(IsoTpError::BadFlowControl));
    a.send(&[1; 20]).unwrap();
    next(&mut a, 0);
    for _ in 0..16 {
        assert_eq!(a.on_frame(&[0x31, 0, 0], 0), Event::None);
    }
    assert_eq!(a.on_frame(&[0x31, 0, 0], 0), Event::Failed(IsoTpError::BadFlowControl));
    assert_eq!(a.send(&[]), Err(SendError::BadLength));
    assert_eq!(a.send(&[0; 601]), Err(SendError::BadLength));
    assert_eq!(a.send(&[0; 600]), Ok(()));
    a.reset();
    assert!(!a.is_sending());
    // A reset message is not requested further.
    a.on_frame(b"\x10\x20abcdef", 0);
    a.reset();
    assert_eq!(next(&mut a, 0), "-");

    let mut small = Endpoint::<10>::new(Timing::default());
    let too_long = Event::Failed(IsoTpError::TooLong);
    assert_eq!(small.on_frame(&[0x10, 11, 1, 1, 1, 1, 1, 1], 0), too_long);
    assert_eq!(next(&mut small, 0), "320000");
    // The single frame also ends a partly received message.
    assert_eq!(small.on_frame(&[0x10, 10, 1, 1, 1, 1, 1, 1], 0), Event::None);
    assert_eq!(small.on_frame(&[0x10, 11, 1, 1, 1, 1, 1, 1], 0), too_long);
    assert_eq!(small.on_frame(&[0x21, 1, 1, 1, 1], 0), Event::None);
    assert_eq!(small.received(), b"");
}

/// A reserved separation time means the longest one, 127 ms, as in the standard.
#[test]
fn reserved_separation_times_are_the_longest() {
    for code in [0x80, 0xF0, 0xFA, 0xFF] {
        let mut a = end(0, 0);
        a.send(&[1; 20]).unwrap();
        next(&mut a, 0);
        a.on_frame(&[0x30, 0, code], 0);
        next(&mut a, 0);
        assert_eq!(next(&mut a, 126_999), "-");
        assert_ne!(next(&mut a, 127_000), "-");
    }
}

/// A first frame is ignored if its message would fit in a single frame, or if it is truncated: no flow control answers it.
#[test]
fn first_frames_that_are_none() {
    let mut b = end(0, 0);
    for frame in [&b"\x10\x03abcdef"[..], b"\x10\x07abcdef", b"\x10\x20abcde", b"\x10"] {
        assert_eq!(b.on_frame(frame, 0), Event::None);
        assert_eq!(next(&mut b, 0), "-");
    }
}

#[test]
fn a_lost_repeated_or_swapped_frame_is_noticed() {
    for numbers in [&[2u8][..], &[1, 1], &[1, 3], &[0], &[2, 1]] {
        let mut b = end(0, 0);
        b.on_frame(&[0x10, 27, 1, 1, 1, 1, 1, 1], 0);
        let failed = numbers.iter().any(|n| {
            b.on_frame(&[0x20 | n, 1, 1, 1, 1, 1, 1, 1], 0) == Event::Failed(IsoTpError::Sequence)
        });
        assert!(failed, "{numbers:?}");
    }
}

/// Transfers frames between two ends until both are silent; `bus` may change frames in transit. Returns the numbers of received
/// and failed messages.
fn exchange(a: &mut End, b: &mut End, mut bus: impl FnMut(Vec<u8>) -> Vec<Vec<u8>>) -> (u32, u32) {
    let (mut received, mut failed, mut now_us, mut idle) = (0, 0, 0, 0);
    while idle < 30 {
        idle += 1;
        for side in 0..2 {
            let (from, to) = if side == 0 { (&mut *a, &mut *b) } else { (&mut *b, &mut *a) };
            // Until it has nothing to send, as the documentation demands.
            loop {
                match from.poll(now_us) {
                    Output::Idle => break,
                    Output::Failed(_) => failed += 1,
                    Output::Send(pdu) => {
                        idle = 0;
                        for data in bus(pdu.data().to_vec()) {
                            match to.on_frame(&data, now_us) {
                                Event::None => {}
                                Event::Received => received += 1,
                                Event::Failed(_) => failed += 1,
                            }
                        }
                    }
                }
            }
        }
        now_us += 100_000;
    }
    assert!(!a.is_sending() && !b.is_sending(), "a message hangs");
    (received, failed)
}

proptest! {
    #[test]
    fn a_good_bus_carries_both_ways_at_once(
        m in proptest::collection::vec(any::<u8>(), 1..=600),
        n in proptest::collection::vec(any::<u8>(), 1..=600),
        block_size in 0u8..20,
        st_min in any::<u8>(),
    ) {
        let (mut a, mut b) = (end(block_size, 0), end(3, st_min));
        a.send(&m).unwrap();
        b.send(&n).unwrap();
        prop_assert_eq!(exchange(&mut a, &mut b, |data| vec![data]), (2, 0));
        prop_assert_eq!(a.received(), &n[..]);
        prop_assert_eq!(b.received(), &m[..]);
    }

    /// A lost frame, at any position, gives an error or nothing, never a wrong message. The next message arrives.
    #[test]
    fn a_lost_frame_is_an_error(
        m in proptest::collection::vec(any::<u8>(), 1..=600),
        block_size in 0u8..20,
        lost in 0usize..60,
    ) {
        let (mut a, mut b) = (end(0, 0), end(block_size, 0));
        a.send(&m).unwrap();
        let mut count = 0;
        let (received, failed) = exchange(&mut a, &mut b, |data| {
            count += 1;
            if count == lost + 1 { vec![] } else { vec![data] }
        });
        if lost < count {
            prop_assert_eq!(received, 0);
            prop_assert!(failed > 0 || m.len() <= 7);
        } else {
            prop_assert_eq!((received, failed), (1, 0));
        }
        a.send(&m).unwrap();
        prop_assert_eq!(exchange(&mut a, &mut b, |data| vec![data]), (1, 0));
        prop_assert_eq!(b.received(), &m[..]);
    }

    /// Repeated and swapped frames give the message or an error, never another message.
    #[test]
    fn a_bad_bus_never_makes_another_message(
        m in proptest::collection::vec(any::<u8>(), 8..=600),
        block_size in 0u8..20,
        faults in proptest::collection::vec((0usize..60, 0u8..2), 0..4),
    ) {
        let (mut a, mut b) = (end(0, 0), end(block_size, 0));
        a.send(&m).unwrap();
        let (mut count, mut held) = (0, None);
        let (received, _) = exchange(&mut a, &mut b, |data| {
            count += 1;
            let mut out = vec![data];
            out.extend(held.take());
            match faults.iter().find(|(at, _)| at + 1 == count) {
                Some((_, 0)) => { let again = out[0].clone(); out.push(again); }
                Some(_) => held = out.pop(),
                None => {}
            }
            out
        });
        if received > 0 {
            prop_assert_eq!(b.received(), &m[..]);
        }
    }

    #[test]
    fn arbitrary_frames(frames in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..=8), 0..60)) {
        let mut end = Endpoint::<40>::new(Timing { block_size: 2, st_min: 0, timeout_us: 5 });
        let _ = end.send(&[9; 30]);
        for (now_us, frame) in frames.iter().enumerate() {
            let event = end.on_frame(frame, now_us as u64);
            prop_assert!(event != Event::Received || !end.received().is_empty());
            let _ = end.poll(now_us as u64);
        }
    }
}
