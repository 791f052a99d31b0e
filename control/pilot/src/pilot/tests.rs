//! Pilots with an operator, whose controller the tests replace.

use super::*;
use rollwalk_planner::plan::Placement;
use rollwalk_planner::receding::{Frame, HorizonError};
use rollwalk_protocol::faults::{FaultBits, Severity};
use rollwalk_protocol::wire::isotp::{Event, Output, Timing};
use rollwalk_protocol::wire::transport::{Endpoint, Hello, Request as LinkRequest, frame_to_host};
use rollwalk_protocol::wire::{
    Action, Command, CommandAck, CommandResult, HeartbeatReply, Node, PROTOCOL_MAJOR,
    PROTOCOL_MINOR, Response, SCHEMA_HASH, Status, ToController,
};

/// Interval of the controller's status, µs.
const STATUS_US: u64 = 50_000;

/// Operator of a controller that stays in a state and refuses all commands.
struct Refusing {
    state: State,
    operator: Operator,
    controller: Endpoint,
    now_us: u64,
    /// Times of the commands to arm or to stream, µs.
    asked_us: Vec<u64>,
}

impl Refusing {
    fn new(state: State) -> Self {
        let operator = Operator::new(node(), None);
        let controller = Endpoint::new(Timing::default());
        Self { state, operator, controller, now_us: 0, asked_us: Vec::new() }
    }

    /// Runs a pilot until it gives up; returns the time, µs, or `None` after 5 s.
    fn runs_until_given_up(&mut self, pilot: &mut Pilot) -> Option<u64> {
        let end_us = self.now_us + 5_000_000;
        while self.now_us < end_us {
            self.step(pilot);
            if pilot.has_given_up(self.now_us, &self.operator.view(self.now_us)) {
                return Some(self.now_us);
            }
        }
        None
    }

    /// Runs pilot, operator and controller for a millisecond.
    fn step(&mut self, pilot: &mut Pilot) {
        if self.now_us.is_multiple_of(STATUS_US) {
            let (severity, faults) = (Severity::None, FaultBits::default());
            let counter = (self.now_us / STATUS_US % 16) as u8;
            let (state, clip, frame, library) = (self.state, None, 0, 0);
            let status = Status { state, severity, faults, clip, frame, counter, library };
            self.operator.on_frame(self.now_us, &status.encode(node()));
        }
        pilot.update(self.now_us, &mut self.operator);
        if let Some(request) = pilot.request(&self.operator) {
            pilot.on_stretch(self.now_us, request, Ok(standing()), &mut self.operator);
        }
        while let Some(frame) = self.operator.poll(self.now_us) {
            match ToController::decode(&frame).unwrap().1 {
                ToController::Heartbeat(heartbeat) => {
                    let controller_ms = (self.now_us / 1000) as u32;
                    let reply = HeartbeatReply { seq: heartbeat.seq, controller_ms };
                    self.operator.on_frame(self.now_us, &reply.encode(node()));
                }
                ToController::Command(command) => self.refuse(command),
                ToController::Transport
                    if self.controller.on_frame(frame.data(), self.now_us) == Event::Received =>
                {
                    self.introduce();
                }
                _ => {}
            }
        }
        while let Output::Send(pdu) = self.controller.poll(self.now_us) {
            self.operator.on_frame(self.now_us, &frame_to_host(node(), &pdu));
        }
        self.now_us += 1_000;
    }

    fn refuse(&mut self, Command { seq, action, .. }: Command) {
        if matches!(action, Action::ArmRequest | Action::Stream) {
            self.asked_us.push(self.now_us);
        }
        let (kind, result, state) = (action.kind(), CommandResult::PoseUnknown, self.state);
        let ack = CommandAck { seq, kind, result, state, motion: None, value: 0 };
        self.operator.on_frame(self.now_us, &ack.encode(node()));
    }

    /// Answers the request for the controller's identity.
    fn introduce(&mut self) {
        let request = LinkRequest::decode(self.controller.received());
        assert!(matches!(request, Ok(LinkRequest::Hello { .. })), "{request:?}");
        let hello = Response::Hello(Hello {
            major: PROTOCOL_MAJOR,
            minor: PROTOCOL_MINOR,
            schema_hash: SCHEMA_HASH,
            config_hash: 7,
            format_major: 1,
            format_minor: 1,
            library: None,
            max_block: 512,
            channels: 2,
        });
        let mut message = [0; 64];
        self.controller.send(hello.encode(&mut message).unwrap()).unwrap();
    }
}

/// Planned standstill of half a second.
fn standing() -> Stretch {
    let frame = Frame { values: vec![0.0; 2], torques_nm: vec![0.0; 2] };
    Stretch {
        frames: vec![frame; 2 * RESERVE],
        iterations: 1,
        accepted: true,
        velocity: [0.0; 3],
        place: Placement::default(),
    }
}

fn node() -> Node {
    Node::new(1).unwrap()
}

/// A drive that a controller refuses ends after the last attempt to arm, whose answer is awaited.
#[test]
fn a_pilot_gives_up_after_the_last_attempt_to_arm() {
    let (mut robot, mut pilot) = (Refusing::new(State::Disarmed), Pilot::new(true));
    let given_up_us = robot.runs_until_given_up(&mut pilot).expect("an end");
    assert_eq!(robot.asked_us.len(), usize::from(ARMS));
    assert!(robot.asked_us.windows(2).all(|pair| pair[1] - pair[0] >= ARM_AGAIN_US));
    let waited_us = given_up_us - robot.asked_us[usize::from(ARMS) - 1];
    assert!((ARM_AGAIN_US..ARM_AGAIN_US + STATUS_US).contains(&waited_us), "{waited_us}");
}

/// A drive ends if the controller does not follow set-points, and requests them once only.
#[test]
fn a_pilot_gives_up_after_a_refused_stream() {
    let (mut robot, mut pilot) = (Refusing::new(State::Ready), Pilot::new(true));
    let given_up_us = robot.runs_until_given_up(&mut pilot).expect("an end");
    let [asked_us] = robot.asked_us[..] else { panic!("{:?}", robot.asked_us) };
    let waited_us = given_up_us - asked_us;
    assert!((AGAIN_US..AGAIN_US + STATUS_US).contains(&waited_us), "{waited_us}");
}

#[test]
fn a_pilot_that_was_stopped_does_not_arm() {
    let (mut robot, mut pilot) = (Refusing::new(State::Disarmed), Pilot::new(true));
    pilot.stop(0, ActionAfterStop::Rest, &mut robot.operator);
    assert_eq!(robot.runs_until_given_up(&mut pilot), Some(1_000));
    (0..1_000).for_each(|_| robot.step(&mut pilot));
    assert!(robot.asked_us.is_empty(), "{:?}", robot.asked_us);
}

/// Slower steering helps if no plan met the constraints, but not if the planner has an error.
#[test]
fn a_horizon_without_a_plan_is_no_failure_of_the_planner() {
    let mut operator = Operator::new(node(), None);
    let failed = HorizonError::TooShort { duration_s: 0.1, samples: 1, interval_s: 0.1, least: 4 };
    let no_plan = CourseError::NoPlan { for_s: 1.0, constraint: String::new(), level: 2.0 };
    for (error, fails) in [(no_plan, false), (CourseError::from(failed), true)] {
        let mut pilot = Pilot::new(true);
        let request = Request { course: 0, wanted: SteeringRequest::default() };
        pilot.on_stretch(0, request, Err(error), &mut operator);
        assert_eq!((pilot.is_unsure(), pilot.has_failed()), (true, fails));
    }
}
