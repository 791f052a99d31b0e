//! The bytes of every transport message. Do not change: the other side may be a robot that nobody
//! updates.

use proptest::prelude::*;
use rollwalk_protocol::library::{Reject, Section, Why};
use rollwalk_protocol::wire::transport::*;

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
    request(Request::Begin { len: 0x12345, crc32c: 0xDEAD_BEEF }, "1045230100efbeadde");
    // CRC-32C of "123456789" is 0xE3069283, the published check value.
    let block = Request::Block { offset: 512, bytes: b"123456789" };
    request(block, "1100020000839206e3313233343536373839");
    request(Request::Finish, "12");
    request(Request::Activate { crc32c: 0xDEAD_BEEF }, "13efbeadde");
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
    let reject = Reject { section: Section::Routes, offset: 0x0102, why: Why::SectionBeyondEnd };
    response(
        Response::Reply(Reply::rejected(0x12, &reject)),
        "90120702010000 0606".replace(' ', "").as_str(),
    );
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
    /// What decodes encodes to the same bytes again.
    #[test]
    fn arbitrary_messages(
        kind in prop_oneof![any::<u8>(), proptest::sample::select(&[0x01u8, 0x10, 0x11, 0x12, 0x13, 0x81, 0x90][..])],
        rest in proptest::collection::vec(any::<u8>(), 0..30),
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
