//! Sessions on a simulated bus on which time passes only during [`LinkBus::receive`].

use super::*;
use rollwalk_bus::link::LinkError;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::{FaultBits, Severity};
use rollwalk_protocol::wire::{
    CommandAck, EstopAck, Heartbeat, HeartbeatReply, ParameterAck, ParameterAction,
    ParameterResult, ToController,
};
use std::collections::VecDeque;

/// Function that returns the answer to a sent frame, if any.
type Answer = Box<dyn FnMut(&ToController) -> Option<Frame>>;

/// Bus on which a controller and other programs send scripted frames.
pub struct Wire {
    now_us: u64,
    said: VecDeque<(u64, Frame)>,
    /// Messages of the host under test, in the order of sending.
    pub sent: Vec<ToController>,
    first_sent_us: Option<u64>,
    answer: Answer,
}

pub fn node() -> Node {
    Node::new(1).unwrap()
}

impl Wire {
    /// Bus without any other node.
    pub fn silent() -> Self {
        Self::answering(|_| None)
    }

    /// Bus with a controller that answers.
    pub fn answering(answer: impl FnMut(&ToController) -> Option<Frame> + 'static) -> Self {
        let (said, sent) = (VecDeque::new(), Vec::new());
        Self { now_us: 0, said, sent, first_sent_us: None, answer: Box::new(answer) }
    }

    /// Schedules a frame of another node at `at_us`, after all frames scheduled earlier.
    pub fn schedule_frame(&mut self, at_us: u64, frame: Frame) {
        self.said.push_back((at_us, frame));
    }

    /// Status of the controller.
    pub fn status(state: State) -> Frame {
        let (faults, severity) = (FaultBits::default(), Severity::None);
        Status { state, severity, faults, clip: None, frame: 0, counter: 0, library: 0 }
            .encode(node())
    }
}

impl LinkBus for Wire {
    fn now_us(&self) -> u64 {
        self.now_us
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        let (_, message) = ToController::decode(frame).expect("a frame of a host");
        self.first_sent_us.get_or_insert(self.now_us);
        self.sent.push(message);
        if let Some(answer) = (self.answer)(&message) {
            self.said.push_front((self.now_us, answer));
        }
        Ok(())
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        let frame = self.said.pop_front_if(|(at_us, _)| *at_us <= deadline_us);
        self.now_us = self.now_us.max(frame.map_or(deadline_us, |(at_us, _)| at_us));
        Ok(frame.map(|(_, frame)| frame))
    }
}

/// Schedules the heartbeats of another host and the controller's replies.
fn beside_a_host(wire: &mut Wire) {
    for seq in 0..100 {
        let at_us = 50_000 * u64::from(seq);
        wire.schedule_frame(at_us, Heartbeat { seq, host_ms: 0 }.encode(node()));
        let controller_ms = 7000 + 50 * u32::from(seq);
        wire.schedule_frame(at_us + 500, HeartbeatReply { seq, controller_ms }.encode(node()));
    }
}

fn is_heartbeat(message: &ToController) -> bool {
    matches!(message, ToController::Heartbeat(_))
}

#[test]
fn a_command_beside_a_host_is_dated_by_its_clock_and_no_heartbeat_goes_out() {
    let mut wire = Wire::answering(|message| match message {
        ToController::Command(command) => {
            let (seq, kind) = (command.seq, command.action.kind());
            let (result, state) = (CommandResult::Ok, State::Playing);
            Some(CommandAck { seq, kind, result, state, motion: None, value: 0 }.encode(node()))
        }
        _ => None,
    });
    beside_a_host(&mut wire);
    // Tests with a whole controller cover HELLO; this one covers the frames before and after it.
    assert!(listener::find_host(&mut wire, node()).unwrap().has_host());
    let mut exchange = Exchange::new(wire, node(), Client::visitor(node()));
    let alive = exchange.pump(CONNECT_TIMEOUT_US, |i| (i == Incoming::Alive).then_some(()));
    assert_eq!(alive, Ok(Some(())));
    exchange.command("pause", Action::Pause).unwrap();
    let [ToController::Command(command)] = exchange.bus.sent[..] else {
        panic!("{:?}", exchange.bus.sent)
    };
    // 7050 ms is the controller's clock in the second heartbeat reply, 500 ms the lifetime of a command.
    assert_eq!(command.valid_until_ms, 7050 + 500);
}

/// The controller executes commands in the order of its answers.
#[test]
fn only_a_return_after_the_latest_command_counts() {
    let ack = |seq, kind, state| {
        let result = CommandResult::Ok;
        CommandAck { seq, kind, result, state, motion: None, value: 0 }.encode(node())
    };
    let mut wire = Wire::answering(|_| None);
    beside_a_host(&mut wire);
    assert!(listener::find_host(&mut wire, node()).unwrap().has_host());
    let mut exchange = Exchange::new(wire, node(), Client::visitor(node()));
    let alive = exchange.pump(CONNECT_TIMEOUT_US, |i| (i == Incoming::Alive).then_some(()));
    assert_eq!(alive, Ok(Some(())));
    // RETURN of another program is acknowledged while the command is on its way.
    let mut sends = 0;
    exchange.bus.answer = Box::new(move |message| match message {
        ToController::Command(command) => {
            sends += 1;
            let (seq, kind) = (command.seq, command.action.kind());
            Some(match sends {
                1 => ack(seq.wrapping_add(9), Action::Return.kind(), State::Returning),
                _ => ack(seq, kind, State::Playing),
            })
        }
        _ => None,
    });
    exchange.command("resume", Action::Resume).unwrap();
    assert!(!exchange.was_returned());
    exchange.bus.answer = Box::new(|_| None);
    let at_us = exchange.bus.now_us;
    exchange.bus.said.push_front((at_us, ack(77, Action::Return.kind(), State::Returning)));
    exchange.pump(1000, |_| None::<()>).unwrap();
    assert!(exchange.was_returned());
}

#[test]
fn a_second_host_is_refused_before_it_sends_anything() {
    let mut wire = Wire::silent();
    beside_a_host(&mut wire);
    let error = Session::connect_alone(&mut wire, node()).err();
    assert_eq!(error, Some(SessionError::HasHost { node: 1 }));
    assert_eq!(wire.sent, []);
}

/// A controller may pause to write its flash between two blocks of another host's transfer.
#[test]
fn beside_a_host_nothing_is_asked_before_half_a_second_without_transport_frames() {
    let block = Frame::standard(0x510, &[0x21, 1, 2, 3]).unwrap();
    for (block_us, asked_us) in [(None, 500_000), (Some(200_000), 700_000)] {
        let mut wire = Wire::silent();
        for seq in 0..100 {
            let at_us = 50_000 * u64::from(seq);
            wire.schedule_frame(at_us, Heartbeat { seq, host_ms: 0 }.encode(node()));
            if block_us == Some(at_us) {
                wire.schedule_frame(at_us, block);
            }
            wire.schedule_frame(
                at_us + 500,
                HeartbeatReply { seq, controller_ms: 0 }.encode(node()),
            );
        }
        Session::join(&mut wire, node()).err().expect("it does not answer");
        // The controller's next frame triggers the request.
        assert_eq!(wire.first_sent_us, Some(asked_us + 500));
    }
}

#[test]
fn without_another_host_the_one_who_joins_is_it() {
    let mut wire = Wire::silent();
    assert!(
        Session::join(&mut wire, node())
            .is_err_and(|error| matches!(error, SessionError::Silent { what: "heartbeat", .. }))
    );
    assert!(!wire.sent.is_empty() && wire.sent.iter().all(is_heartbeat), "{:?}", wire.sent);
}

/// A console that ends during the connection leaves a controller that sends its status but answers no heartbeats.
#[test]
fn a_host_that_ends_while_another_joins_is_replaced() {
    let mut wire = Wire::answering(|message| match message {
        ToController::Heartbeat(heartbeat) => {
            Some(HeartbeatReply { seq: heartbeat.seq, controller_ms: 0 }.encode(node()))
        }
        _ => None,
    });
    for seq in 0..2 {
        wire.schedule_frame(50_000 * u64::from(seq), Heartbeat { seq, host_ms: 0 }.encode(node()));
    }
    for n in 2..60 {
        wire.schedule_frame(50_000 * n, Wire::status(State::Returning));
    }
    let error = Session::join(&mut wire, node()).err().expect("HELLO is not answered here");
    let text = error.to_string();
    assert!(!text.contains("heartbeat"), "{text}");
    assert!(wire.sent.iter().any(is_heartbeat), "{:?}", wire.sent);
    assert!(text.contains("its status arrives"), "{text}");
}

#[test]
fn another_controller_on_the_bus_is_named() {
    let mut wire = Wire::silent();
    for n in 0..60 {
        wire.schedule_frame(50_000 * n, Wire::status(State::Disarmed));
    }
    let error = Session::connect(&mut wire, Node::new(3).unwrap()).err().unwrap();
    assert_eq!(
        error.to_string(),
        "controller 3 does not answer (heartbeat): controller 1 is on this bus; to use it, give --node 1"
    );
}

#[test]
fn an_emergency_stop_goes_on_until_it_is_acknowledged() {
    let mut stops = 0;
    let mut wire = Wire::answering(move |message| {
        stops += u32::from(*message == ToController::Estop);
        // Five at once, then ten per second: the hundredth after 9.5 s.
        (stops == 100).then(|| EstopAck { state: State::EStopped }.encode(node()))
    });
    let mut told = Vec::new();
    Session::estop_at(&mut wire, node(), |error| told.push(error)).unwrap();
    assert_eq!(wire.sent, [ToController::Estop; 100]);
    // After 0.5 s, and then every 3 s.
    assert_eq!(told.len(), 4);
    assert!(told[0].to_string().contains("(emergency stop): check its power"), "{}", told[0]);
}

/// Bus on a busy computer: the first wait is too long, and frames that have arrived are read after it.
struct Late(Wire, bool);

impl LinkBus for Late {
    fn now_us(&self) -> u64 {
        self.0.now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.0.send(frame)
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        if std::mem::take(&mut self.1) {
            self.0.now_us = deadline_us + 200_000;
            return Ok(None);
        }
        self.0.receive(deadline_us)
    }
}

#[test]
fn what_arrived_while_the_computer_was_late_is_no_silence() {
    let mut wire = Wire::silent();
    wire.schedule_frame(30_000, Wire::status(State::Ready));
    let mut exchange = Exchange::new(Late(wire, true), node(), Client::visitor(node()));
    let heard =
        exchange.pump(60_000, |incoming| matches!(incoming, Incoming::Status(_)).then_some(()));
    assert_eq!(heard, Ok(Some(())));
    let begun_us = exchange.bus.now_us();
    assert_eq!(exchange.pump(60_000, |_| None::<()>), Ok(None));
    assert_eq!(exchange.bus.now_us(), begun_us + 60_000);
}

#[test]
fn a_silence_while_the_computer_was_late_says_so() {
    let mut exchange = Exchange::new(Late(Wire::silent(), true), node(), Client::visitor(node()));
    let why = |exchange: &mut Exchange<Late>| {
        assert_eq!(exchange.pump(60_000, |_| None::<()>), Ok(None));
        exchange.silent("pause").to_string()
    };
    let said = why(&mut exchange);
    assert!(said.contains("delayed this program by 200 ms"), "{said}");
    // An old fault does not explain a silence long afterwards.
    exchange.pump(1_000_000, |_| None::<()>).unwrap();
    let said = why(&mut exchange);
    assert!(said.ends_with("(pause): check its power, and that it is on this bus"), "{said}");
}

#[test]
fn a_command_that_was_late_is_sent_once_more() {
    let mut refusals = 2;
    let wire = Wire::answering(move |message| match message {
        ToController::Heartbeat(heartbeat) => {
            Some(HeartbeatReply { seq: heartbeat.seq, controller_ms: 7000 }.encode(node()))
        }
        ToController::Command(command) => {
            let (seq, kind) = (command.seq, command.action.kind());
            let late = refusals > 0;
            refusals -= u32::from(late);
            let result = if late { CommandResult::Expired } else { CommandResult::Ok };
            let state = State::Playing;
            Some(CommandAck { seq, kind, result, state, motion: None, value: 0 }.encode(node()))
        }
        _ => None,
    });
    let mut exchange = Exchange::new(wire, node(), Client::new(node()));
    exchange.pump(10_000, |_| None::<()>).unwrap();
    exchange.command("pause", Action::Pause).unwrap();
    let commands = exchange.bus.sent.iter().filter_map(|message| match message {
        ToController::Command(command) => Some(command.seq),
        _ => None,
    });
    assert_eq!(commands.collect::<Vec<_>>(), [1, 2, 3]);
}

/// Bus on which a controller acknowledges SAVE after `erasing_us`.
fn saving(erasing_us: u64) -> Wire {
    let mut wire = Wire::silent();
    let (kind, result) = (ParameterAction::Save.kind(), ParameterResult::Ok);
    let ack = ParameterAck { seq: 1, kind, result, parameter: 0, channel: None, value: 0.0 };
    wire.schedule_frame(erasing_us, ack.encode(node()));
    wire
}

/// The slowest sectors of microcontrollers take 4 s to erase, and a computer synchronises a file in up to 20 s while its disk is
/// busy.
#[test]
fn a_memory_that_takes_seconds_to_erase_is_waited_for() {
    for erasing_us in [1_000, 4_000_000, 20_000_000] {
        let mut exchange = Exchange::new(saving(erasing_us), node(), Client::visitor(node()));
        assert_eq!(exchange.parameter("save", ParameterAction::Save), Ok(0.0));
        assert_eq!(exchange.bus.now_us(), erasing_us);
    }
    // Other requests do not erase.
    let mut exchange = Exchange::new(saving(4_000_000), node(), Client::visitor(node()));
    exchange.parameter("reset", ParameterAction::Reset).unwrap_err();
    assert_eq!(exchange.bus.now_us(), 540_000);
}
