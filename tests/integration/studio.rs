//! Tests of a robot behind `rollwalk studio --bus`. The page that connects and plays it is a session in the test.

use crate::desk;
use crate::simulated::{Robot, desk_with_library_file};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_host::session::Session;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{Deframer, Packet};
use rollwalk_protocol::wire::{Node, State, Status};
use rollwalk_tests::Desk;
use rollwalk_tests::program::{LONG, Program, within};
use std::collections::VecDeque;
use std::fs::File;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::process::Stdio;
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Error, Message, WebSocket};

/// File with the error output of `rollwalk studio`.
const SAID: &str = "studio.said";
const LONG_US: u64 = LONG.as_micros() as u64;

/// Running studio; ended on drop.
struct Studio {
    program: Program,
    address: String,
}

impl Studio {
    fn start(desk: &Desk, bus: &str) -> Self {
        let mut command = desk.command(&["studio", "--no-open", "--bus", bus]);
        let said = File::create(desk.path(SAID)).expect("a file");
        let program = Program::start(command.stdout(Stdio::piped()).stderr(said));
        let said = program.wait_for_words("the studio is at http://");
        let line = said.lines().next().expect("a line");
        let address = line.strip_prefix("the studio is at http://").expect("its address");
        Self { address: address.to_owned(), program }
    }

    fn page(&self) -> Page {
        let (server, query) = self.address.split_once('/').expect("an address");
        let address = format!("ws://{server}/link{query}");
        let mut request = address.into_client_request().expect("a request");
        let origin = format!("http://{server}").parse().expect("an origin");
        request.headers_mut().insert("Origin", origin);
        let stream = TcpStream::connect(server).expect("the studio listens");
        stream.set_read_timeout(Some(LONG)).expect("a timeout");
        let (socket, _) = tungstenite::client(request, stream).expect("it lets its page in");
        Page {
            socket,
            deframer: Deframer::default(),
            frames: VecDeque::new(),
            started: Instant::now(),
        }
    }
}

/// Page's end of the relay.
struct Page {
    socket: WebSocket<TcpStream>,
    deframer: Deframer,
    frames: VecDeque<Frame>,
    started: Instant,
}

impl LinkBus for Page {
    fn now_us(&self) -> u64 {
        self.started.elapsed().as_micros() as u64
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        let packet = Packet::Link(*frame).encode().expect("a frame of the link");
        let sent = self.socket.send(Message::binary(packet.to_vec()));
        sent.map_err(|error| LinkError::Down(error.to_string()))
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        loop {
            if let Some(frame) = self.frames.pop_front() {
                return Ok(Some(frame));
            }
            // A timeout of zero would mean no timeout.
            let wait_us = deadline_us.saturating_sub(self.now_us()).max(1);
            let wait = Some(Duration::from_micros(wait_us));
            self.socket.get_ref().set_read_timeout(wait).expect("a timeout");
            match self.socket.read() {
                Ok(Message::Binary(bytes)) => {
                    for &byte in &bytes {
                        if let Some(Packet::Link(frame)) =
                            self.deframer.push(byte).and_then(Packet::decode)
                        {
                            self.frames.push_back(frame);
                        }
                    }
                }
                Ok(Message::Close(why)) => {
                    return Err(LinkError::Down(why.expect("a reason").reason.to_string()));
                }
                Ok(_) => {}
                Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => {
                    if self.now_us() >= deadline_us {
                        return Ok(None);
                    }
                }
                Err(error) => return Err(LinkError::Down(error.to_string())),
            }
        }
    }
}

/// Waits until the studio has printed this.
fn wait_for_words(desk: &Desk, words: &str) {
    let said = || desk.read_text(SAID).contains(words).then_some(());
    within(&format!("{words:?} in {SAID}"), said);
}

#[test]
fn a_robot_is_flashed_armed_played_and_stopped_through_the_studio() {
    let desk = desk_with_library_file();
    desk.make(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]);
    let library = desk.read("legbot.rwl");
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let mut robot = Robot::start(&desk, &bus);
    let studio = Studio::start(&desk, &bus);
    let node = Node::new(1).expect("a node");

    let mut session = Session::connect_alone(studio.page(), node).expect("it answers");
    session.flash(&library, |_| {}).expect("it takes the library");
    session.arm().expect("it can be armed");
    session.wait_for_state(State::Ready, LONG_US).expect("it stands");
    session.select(2).expect("it has this motion");
    session.wait_for_state(State::Playing, LONG_US).expect("it plays");
    // The page crashes: heartbeats end, and the robot returns to SAFE.
    drop(session);
    wait_for_words(&desk, "the page has left sim:");
    // After the robot has detected the loss of that host.
    let start = Instant::now();
    let mut session = loop {
        match Session::connect_alone(studio.page(), node) {
            Ok(session) => break session,
            Err(error) => assert!(start.elapsed() < LONG, "{error}"),
        }
    };
    let is_safe = |status: &Status| (status.state == State::TorqueOff).then_some(true);
    session.wait_until("SAFE without torque", LONG_US, is_safe).expect("it returns");

    session.clear().expect("the lost host is forgiven");
    session.arm().expect("it can be armed again");
    session.wait_for_state(State::Ready, LONG_US).expect("it stands");
    session.select(2).expect("it has this motion");
    session.wait_for_state(State::Playing, LONG_US).expect("it plays");
    session.estop().expect("it stops");
    session.wait_for_state(State::EStopped, LONG_US).expect("it has stopped");
    // The robot's computer disappears; page and terminal report it.
    robot.stop();
    let error = session.run_for(LONG_US).expect_err("there is no bus");
    assert!(error.to_string().contains("the simulated robot"), "{error}");
    wait_for_words(&desk, "the other end closed the connection");
    let mut page = studio.page();
    let error = page.receive(LONG_US).expect_err("there is no robot");
    assert!(error.to_string().contains("no simulated robot at"), "{error}");
}

#[test]
fn only_what_the_page_edits_is_opened() {
    let desk = desk();
    desk.write("README.md", "# A robot\n");
    desk.write("servos.toml", "[[servo]]\nname = \"s\"\n");
    desk.write("plan.json", "{\"format\": \"rollwalk-plan\"}");
    let run = |file| desk.run(&["studio", file, "--no-open"]);
    for (file, what, help) in [
        ("README.md", "README.md is a file of another kind", "without a file"),
        ("servos.toml", "servos.toml is a file of another kind", "without a file"),
    ] {
        run(file).fails(1, &["robot, motion, library and design files (TOML)", what, help]);
    }
    run("plan.json").fails(1, &["plan.json is damaged", "rollwalk plan MOTION.toml"]);
}

#[test]
fn a_bus_that_cannot_be_opened_is_an_error_at_the_start() {
    let desk = desk();
    let run = |bus| desk.run(&["studio", "--no-open", "--bus", bus]);
    run("sim:nobody.sock")
        .fails(1, &["no simulated robot at nobody.sock", "start a simulated robot: rollwalk-sim"]);
    run("can0").fails(2, &["`can0` is not a bus", "such as can:can0"]);
}

/// Checks that a signal ends programs that run until Ctrl-C with 0, as their help texts state.
#[test]
fn a_signal_ends_studio_and_robot_with_0() {
    let desk = desk_with_library_file();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    for name in ["INT", "TERM"] {
        let mut robot = Robot::start(&desk, &bus);
        let Studio { program, .. } = Studio::start(&desk, &bus);
        program.signal(name);
        assert_eq!(program.ends().code, 0, "{name}");
        robot.end_by(name);
    }
}
