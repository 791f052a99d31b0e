//! Golden bytes of an authenticated link. Their codes were computed by another implementation, Python's `hmac`, over the fields
//! in `docs/formats/wire-format.md`.

use proptest::prelude::*;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::authentication::*;
use rollwalk_protocol::wire::transport::TransportError;
use rollwalk_protocol::wire::{Action, Command, DecodeError, Estop, Node, ToController};

const SESSION: LinkSession =
    LinkSession { number: 0x0102_0304_0506_070B, nonce: 0x1112_1314_1516_1718 };

fn node() -> Node {
    Node::new(3).unwrap()
}

#[test]
fn authenticator() {
    let sent = Authenticator {
        session: SESSION.short(),
        subject: Subject::Command,
        counter: 0xFE,
        tag: [1, 2, 3, 4, 5, 6],
    };
    let frame = sent.encode(node());
    assert_eq!(frame.to_string().to_lowercase(), "032#2bfe010203040506");
    assert_eq!(Authenticator::decode(&frame), Ok((node(), sent)));
    // A host and a controller without authentication ignore it.
    assert_eq!(ToController::decode(&frame), Err(DecodeError::OtherMessage));
    for class in [0, 3, 4, 7, 15] {
        let other = Frame::standard(0x032, &[class << 4, 0, 1, 2, 3, 4, 5, 6]).unwrap();
        assert_eq!(Authenticator::decode(&other), Err(DecodeError::BadValue));
    }
    let short = Frame::standard(0x032, &[0x20, 0, 1, 2, 3, 4, 5]).unwrap();
    assert_eq!(Authenticator::decode(&short), Err(DecodeError::BadLength));
    assert_eq!(Authenticator::decode(&Estop.encode(node())), Err(DecodeError::OtherMessage));
}

#[test]
fn session_messages() {
    let request = SessionRequest { nonce: SESSION.nonce };
    let bytes = request.encode();
    assert_eq!(bytes, [0x03, 0x18, 0x17, 0x16, 0x15, 0x14, 0x13, 0x12, 0x11]);
    assert_eq!(SessionRequest::decode(&bytes), Ok(request));
    assert_eq!(SessionRequest::decode(&bytes[..8]), Err(TransportError::BadLength));
    assert_eq!(SessionRequest::decode(&[]), Err(TransportError::BadLength));

    let offer = SessionOffer { number: SESSION.number, tag: *b"ABCDEFGH" };
    let bytes = offer.encode();
    assert_eq!(bytes, *b"\x83\x0b\x07\x06\x05\x04\x03\x02\x01ABCDEFGH");
    assert_eq!(SessionOffer::decode(&bytes), Ok(offer));
    assert_eq!(SessionOffer::decode(&bytes[..16]), Err(TransportError::BadLength));
    let longer = [bytes.as_slice(), &[0]].concat();
    assert_eq!(SessionOffer::decode(&longer), Err(TransportError::BadLength));
    assert_eq!(SessionOffer::decode(&request.encode()), Err(TransportError::UnknownType(3)));
}

#[test]
fn counters_rise_to_the_next_with_these_bits() {
    let after = |counter, last| {
        let subject = Subject::Command;
        Authenticator { session: 0, subject, counter, tag: [0; TAG_LEN] }.counter_after(last)
    };
    assert_eq!(after(1, 0), Some(1));
    assert_eq!(after(0, 0), Some(256));
    assert_eq!(after(0xFF, 0x1FE), Some(0x1FF));
    assert_eq!(after(0xFE, 0x1FE), Some(0x2FE));
    assert_eq!(after(0xFD, 0x1FE), Some(0x2FD));
    assert_eq!(after(0xFF, u32::MAX - 1), Some(u32::MAX));
    assert_eq!(after(0, u32::MAX), None);
}

#[cfg(feature = "authenticated")]
mod codes {
    use super::*;

    fn key() -> LinkKey {
        let mut bytes = [0; LINK_KEY_LEN];
        (0..).zip(&mut bytes).for_each(|(k, byte)| *byte = k);
        LinkKey::new(&bytes)
    }

    #[test]
    fn of_another_implementation() {
        let action = Action::Play { code: 20, speed_64ths: 64 };
        let command = Command { seq: 5, action, valid_until_ms: 10_000 }.encode(node());
        assert_eq!(command.to_string().to_lowercase(), "230#2305144000001027");
        let tag = key().tag(&SESSION, 0x1FE, 0x230, command.data());
        assert_eq!(tag, hex("ef24036dbf3d"));
        let activate = [0x13, 0x26, 0x39, 0xF4, 0xCB];
        assert_eq!(key().tag(&SESSION, 1, request_id(node()), &activate), hex("563aaa56f71b"));
        let mut block = vec![0x11, 0, 2, 0, 0, 0, 0, 0, 0];
        block.extend((0..512u32).map(|k| (7 * k) as u8));
        assert_eq!(key().tag(&SESSION, 0x10000, 0x530, &block), hex("4883efa95aa8"));
        assert_eq!(key().offer_tag(&SESSION, response_id(node())), hex("60d1f8d79a634be8"));
    }

    fn hex<const N: usize>(digits: &str) -> [u8; N] {
        let byte = |k: usize| u8::from_str_radix(&digits[2 * k..2 * k + 2], 16).unwrap();
        std::array::from_fn(byte)
    }

    #[test]
    fn a_key_is_not_printed() {
        assert_eq!(format!("{:?}", key()), "LinkKey(secret)");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(if cfg!(miri) { 2 } else { 256 }))]

        /// A single changed bit in message, tag or key makes the tag wrong.
        #[test]
        fn every_bit_counts(
            number: u64, nonce: u64, counter: u32, id in 0u16..0x800, data: [u8; 8], bit in 0usize..64,
        ) {
            let session = LinkSession { number, nonce };
            let key = key();
            let tag = key.tag(&session, counter, id, &data);
            let fits = |tag: &_, session: &_, counter, id, data: &[u8]| {
                key.is_tag(tag, session, counter, id, data)
            };
            prop_assert!(fits(&tag, &session, counter, id, &data));
            let other_number = LinkSession { number: number ^ 1 << bit, nonce };
            prop_assert!(!fits(&tag, &other_number, counter, id, &data));
            let other_nonce = LinkSession { number, nonce: nonce ^ 1 << bit };
            prop_assert!(!fits(&tag, &other_nonce, counter, id, &data));
            prop_assert!(!fits(&tag, &session, counter ^ 1 << (bit % 32), id, &data));
            prop_assert!(!fits(&tag, &session, counter, id ^ 1 << (bit % 11), &data));
            let mut other = data;
            other[bit / 8] ^= 1 << (bit % 8);
            prop_assert!(!fits(&tag, &session, counter, id, &other));
            prop_assert!(!fits(&tag, &session, counter, id, &data[..7]));
            let mut other = tag;
            other[bit % 48 / 8] ^= 1 << (bit % 8);
            prop_assert!(!fits(&other, &session, counter, id, &data));
            let mut bytes = [0; LINK_KEY_LEN];
            (0..).zip(&mut bytes).for_each(|(k, byte)| *byte = k);
            bytes[bit % LINK_KEY_LEN] ^= 1 << (bit % 8);
            prop_assert!(!LinkKey::new(&bytes).is_tag(&tag, &session, counter, id, &data));
            let offer = key.offer_tag(&session, id);
            prop_assert!(key.is_offer_tag(&offer, &session, id));
            prop_assert!(!key.is_offer_tag(&offer, &other_nonce, id));
            prop_assert!(!key.is_offer_tag(&offer, &session, id ^ 1 << (bit % 11)));
        }
    }
}
