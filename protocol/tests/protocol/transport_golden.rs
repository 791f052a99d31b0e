//! Golden bytes of every transport message. Do not change them: the other side may be a robot with old firmware.

use proptest::prelude::*;
use rollwalk_protocol::faults::{Event, Fault};
use rollwalk_protocol::library::{Reject, RejectReason, Section};
use rollwalk_protocol::wire::transport::*;
use rollwalk_protocol::wire::{LOG_ENTRY_BYTES, Log, LogEntry, MAX_LOG_ENTRIES, State};

fn hex(bytes: Option<&[u8]>) -> String {
    bytes.expect("fits").iter().map(|b| format!("{b:02x}")).collect()
}

#[track_caller]
fn request(request: Request<'_>, golden: &str) {
    let mut out = [0; MAX_MESSAGE];
    let bytes = request.encode(&mut out);
    assert_eq!(hex(bytes), golden);
    assert_eq!(Request::decode(bytes.unwrap()), Ok(request));
}

#[track_caller]
fn response(response: Response, golden: &str) {
    let mut out = [0; MAX_MESSAGE];
    let bytes = response.encode(&mut out);
    assert_eq!(hex(bytes), golden);
    assert_eq!(Response::decode(bytes.unwrap()), Ok(response));
}

#[test]
fn requests() {
    request(Request::Hello { major: 1, minor: 0 }, "010100");
    request(Request::Log { since: 0x0403_0201 }, "0201020304");
    request(Request::Begin { len: 0x12345, digest: 0xDEAD_BEEF }, "1045230100efbeadde");
    // CRC-32C of "123456789" is 0xE3069283, the published check value.
    let block = Request::Block { offset: 512, bytes: b"123456789" };
    request(block, "1100020000839206e3313233343536373839");
    request(Request::Finish, "12");
    request(Request::Activate { digest: 0xDEAD_BEEF }, "13efbeadde");
}

#[test]
fn responses() {
    let hello = Hello {
        major: 1,
        minor: 0,
        schema_hash: 0x0403_0201,
        config_hash: 0x0807_0605,
        format_major: 1,
        format_minor: 0,
        library: Some(0x0C0B_0A09),
        max_block: 512,
        channels: 12,
    };
    response(Response::Hello(hello), "81010001020304050607080100000001090a0b0c00020c");
    let none = Hello { library: None, ..hello };
    response(
        Response::Hello(none),
        "81010001020304050607080100000000000000000002 0c".replace(' ', "").as_str(),
    );
    let reply = Reply::new(0x11, TransferResult::OutOfOrder, 1024);
    response(Response::Reply(reply), "901103000400000000");
    let reject =
        Reject { section: Section::Routes, offset: 0x0102, why: RejectReason::SectionBeyondEnd };
    response(
        Response::Reply(Reply::rejected(0x12, &reject)),
        "90120702010000 0606".replace(' ', "").as_str(),
    );
}

#[test]
fn log() {
    let lost = LogEntry {
        at_ms: 0x0403_0201,
        event: Event::HostLost.code(),
        before: State::Playing,
        after: State::Returning,
        fault: Some(Fault::HostLost),
        channel: None,
        value: 0.25,
    };
    let silent = LogEntry {
        event: Event::FeedbackLost.code(),
        before: State::Returning,
        after: State::Damped,
        fault: Some(Fault::ActuatorSilent),
        channel: Some(7),
        value: 0.125,
        ..lost
    };
    let off = LogEntry {
        event: Event::DampingElapsed.code(),
        before: State::Damped,
        after: State::TorqueOff,
        fault: None,
        channel: None,
        value: 0.0,
        ..lost
    };
    let mut log = Log::new(0x0807_0605, 40, 43);
    let head = "8205060708280000002b000000";
    response(Response::Log(log), head);
    for entry in [lost, silent, off] {
        assert!(log.push(entry.encode()));
    }
    let entries =
        ["010203040c7502ff0000803e", "01020304038703070000003e", "010203041998ffff00000000"];
    let golden = [head, &entries.concat()].concat();
    response(Response::Log(log), &golden);
    assert_eq!(log.entries().collect::<Vec<_>>(), [(40, lost), (41, silent), (42, off)]);
    // A log of a later version, with an unknown state. The other entries keep their numbers.
    let mut later = Log::new(0, u32::MAX, 2);
    let strange = [0, 0, 0, 0, 200, 0xF9, 0xFF, 0xFF, 0, 0, 0, 0];
    assert!([lost.encode(), strange, off.encode()].into_iter().all(|e| later.push(e)));
    assert_eq!(later.entries().collect::<Vec<_>>(), [(u32::MAX, lost), (1, off)]);
    let event = LogEntry { event: 200, ..lost };
    assert_eq!(LogEntry::decode(&event.encode()), Some(event));
}

#[test]
fn a_log_has_room_for_so_many_entries() {
    let mut log = Log::new(1, 0, 100);
    let entry = [0; LOG_ENTRY_BYTES];
    let pushed = (0..40).filter(|_| log.push(entry)).count();
    assert_eq!(pushed, MAX_LOG_ENTRIES);
    let mut out = [0; 300];
    let len = Response::Log(log).encode(&mut out).unwrap().len();
    assert_eq!(len, 13 + 12 * 16);
    assert_eq!(Response::decode(&out[..len]), Ok(Response::Log(log)));
    for bad in [12, 14, len - 1, len + 1, len + 12] {
        assert_eq!(Response::decode(&out[..bad]), Err(TransportError::BadLength), "{bad}");
    }
}

#[test]
fn blocks_of_wrong_size_or_content_are_refused() {
    let mut out = [0; 1024];
    let block = |bytes| Request::Block { offset: 0, bytes };
    assert_eq!(block(&[]).encode(&mut out), None);
    assert_eq!(block(&[0; MAX_BLOCK + 1]).encode(&mut out), None);
    assert_eq!(block(&[7; MAX_BLOCK]).encode(&mut out).unwrap().len(), MAX_MESSAGE);
    for at in 5..MAX_MESSAGE {
        out[at] ^= 0x10;
        assert_eq!(Request::decode(&out[..MAX_MESSAGE]), Err(TransportError::BadCrc));
        out[at] ^= 0x10;
    }
    assert_eq!(Request::decode(&out[..9]), Err(TransportError::BadLength));
    assert_eq!(Request::decode(&[]), Err(TransportError::BadLength));
    assert_eq!(Request::decode(&[0x12, 0]), Err(TransportError::BadLength));
    assert_eq!(Request::decode(&[0x77]), Err(TransportError::UnknownType(0x77)));
}

proptest! {
    /// Decoded messages encode to the same bytes again.
    #[test]
    fn arbitrary_messages(
        kind in prop_oneof![any::<u8>(), proptest::sample::select(&[0x01u8, 0x02, 0x10, 0x11, 0x12, 0x13, 0x81, 0x82, 0x90][..])],
        rest in proptest::collection::vec(any::<u8>(), 0..50),
    ) {
        let message = [&[kind], &rest[..]].concat();
        let mut out = [0; MAX_MESSAGE];
        if let Ok(request) = Request::decode(&message) {
            prop_assert_eq!(request.encode(&mut out), Some(&message[..]));
        }
        if let Ok(response) = Response::decode(&message) {
            prop_assert_eq!(response.encode(&mut out), Some(&message[..]));
        }
    }
}
