//! Tests of the relay between a page and a bus. Other sites and other programs must not get the bus. The test acts as the robot
//! on the bus.

use super::{TestServer, start, start_with};
use crate::studio::relay::Relay;
use rollwalk_bus::link::LinkBus;
use rollwalk_bus::name::BusName;
use rollwalk_bus::port::LiveLink;
use rollwalk_bus::sim;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::Packet;
use std::net::TcpStream;
use tempfile::TempDir;
use tungstenite::{Message, WebSocket};

type Page = WebSocket<TcpStream>;

/// Timeout of answers that must arrive, µs; far longer than needed.
const LONG_US: u64 = 60_000_000;
/// Wait for frames that must not arrive, µs.
const SHORT_US: u64 = 50_000;

/// Robot's end of a bus, and a server that relays the bus.
struct Bench {
    robot: LiveLink,
    server: TestServer,
    _folder: TempDir,
}

fn bench() -> Bench {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("robot.sock");
    let robot = LiveLink::new(sim::serve(Some(&socket)).unwrap());
    let bus = BusName::Sim { socket: Some(socket) };
    let server = start_with(&[], Some(Relay::new(bus).unwrap()));
    Bench { robot, server, _folder: folder }
}

impl Bench {
    fn page(&self) -> Page {
        self.server.own_at("link")
    }

    /// Opens a page that gets the bus after the previous page has released it.
    fn next_page(&mut self) -> Page {
        for _ in 0..100 {
            let mut page = self.page();
            // The server may answer with a refusal instead.
            if page.send(packets(&[frame(7)])).is_ok()
                && let Ok(Some(heard)) = self.robot.receive(self.robot.now_us() + SHORT_US)
            {
                assert_eq!(heard, frame(7));
                return page;
            }
        }
        panic!("no page gets the bus");
    }

    fn receive_within(&mut self, us: u64) -> Option<Frame> {
        self.robot.receive(self.robot.now_us() + us).unwrap()
    }
}

fn frame(id: u16) -> Frame {
    Frame::standard(id, &[1, 0, 3]).unwrap()
}

fn packets(frames: &[Frame]) -> Message {
    let packets = frames.iter().flat_map(|frame| Packet::Link(*frame).encode().unwrap());
    Message::binary(packets.collect::<Vec<u8>>())
}

/// Returns the reason with which the server closes a page.
fn close_reason(page: &mut Page) -> String {
    loop {
        match page.read() {
            Ok(Message::Close(Some(frame))) => return frame.reason.to_string(),
            Ok(_) => {}
            Err(error) => panic!("nothing was said: {error}"),
        }
    }
}

#[test]
fn frames_pass_both_ways_and_none_before_the_page_sends_one() {
    let mut bench = bench();
    let mut page = bench.page();
    assert_eq!(bench.receive_within(SHORT_US), None);
    page.send(packets(&[frame(1), frame(2)])).unwrap();
    assert_eq!(bench.receive_within(LONG_US), Some(frame(1)));
    assert_eq!(bench.receive_within(LONG_US), Some(frame(2)));
    bench.robot.send(&frame(3)).unwrap();
    assert_eq!(page.read().unwrap(), packets(&[frame(3)]));
}

#[test]
fn one_page_at_a_time_has_the_bus() {
    let mut bench = bench();
    let mut first = bench.next_page();
    let mut second = bench.page();
    let words = close_reason(&mut second);
    assert!(words.starts_with("another page uses sim:"), "{words}");
    first.send(packets(&[frame(1)])).unwrap();
    assert_eq!(bench.receive_within(LONG_US), Some(frame(1)));
    drop(first);
    bench.next_page();
}

#[test]
fn a_page_that_sends_no_packets_is_sent_away_and_nothing_goes_out() {
    let mut bench = bench();
    for bad in [
        Message::binary(vec![0xff; 1000]),
        Message::binary([packets(&[frame(1)]).into_data(), vec![5].into()].concat()),
        Message::binary(Packet::Ask.encode().unwrap().to_vec()),
        Message::text("frames"),
    ] {
        let mut page = bench.next_page();
        page.send(bad).unwrap();
        assert!(close_reason(&mut page).contains("not packets of frames"));
        assert_eq!(bench.receive_within(SHORT_US), None);
    }
    // The server closes a connection whose message is too long.
    let mut page = bench.next_page();
    let _ = page.send(Message::binary(vec![0; 1_000_000]));
    assert!(page.read().is_err());
    assert_eq!(bench.receive_within(SHORT_US), None);
    bench.next_page();
}

#[test]
fn only_the_own_page_has_the_bus() {
    let bench = bench();
    let TestServer { port, token } = &bench.server;
    let own = format!("http://127.0.0.1:{port}");
    for (origin, token) in [
        ("https://evil.example", &**token),
        ("null", token),
        (&own, ""),
        (&own, "ffffffffffffffffffffffffffffffff"),
    ] {
        match bench.server.socket("link", origin, token) {
            Err(error) => assert!(error.to_string().contains("403"), "{error}"),
            Ok(_) => panic!("{origin} with `{token}` was let in"),
        }
    }
    let [host, origin] = [format!("Host: 127.0.0.1:{port}"), format!("Origin: {own}")];
    let link = format!("GET /link?token={token}");
    assert_eq!(bench.server.status(&link, &[&host]), 403, "without an origin");
    assert_eq!(bench.server.status(&link, &[&host, &origin]), 400, "no WebSocket");
}

#[test]
fn the_page_is_told_which_bus_it_may_have() {
    let page = |server: &TestServer| {
        let TestServer { port, token } = server;
        let request = format!("GET /?token={token} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n");
        server.exchange(request.as_bytes())
    };
    let bench = bench();
    assert!(page(&bench.server).contains("<meta name=\"relay\" content=\"sim:/"));
    let without = start(&[]);
    assert!(!page(&without).contains("\"relay\""));
    let TestServer { port, token } = &without;
    let refused = without.socket("link", &format!("http://127.0.0.1:{port}"), token);
    assert!(refused.unwrap_err().to_string().contains("404"));
}

#[test]
fn a_bus_that_cannot_be_opened_is_an_error_at_the_start() {
    let socket = Some("/no/such/robot.sock".into());
    let error = Relay::new(BusName::Sim { socket }).err().unwrap();
    assert!(error.to_string().contains("no simulated robot at /no/such/robot.sock"), "{error}");
    assert!(
        error
            .help()
            .unwrap()
            .to_string()
            .starts_with("start a simulated robot: rollwalk-sim ROBOT.toml")
    );
}
