//! Messages to a controller that requires a link key: which messages need an authenticator, and that only the authenticator of
//! the host's next message is valid.

use crate::rig::{Rig, me};
use crate::robot;
use crate::transfer::{flash, result};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::{Event, Fault};
use rollwalk_protocol::wire::authentication::*;
use rollwalk_protocol::wire::transport::TransferResult;
use rollwalk_protocol::wire::{
    Action, Command, CommandResult, Discover, FromController, Heartbeat, Parameter,
    ParameterAction, ParameterResult, Request, Response, Setpoint, State,
};

pub const BOOT: u32 = 7;
pub const NONCE: u64 = 0x0123_4567_89AB_CDEF;

pub fn key() -> LinkKey {
    LinkKey::new(&[0x42; LINK_KEY_LEN])
}

/// Host with a session.
#[derive(Clone)]
pub struct Prover {
    key: LinkKey,
    pub session: LinkSession,
    pub counters: [u32; COUNTERS],
    /// Authenticated messages sent so far: authenticator, identifier and bytes.
    pub sent: Vec<(Frame, u16, Vec<u8>)>,
}

impl Prover {
    pub fn new(key: LinkKey, session: LinkSession) -> Self {
        Self { key, session, counters: [0; COUNTERS], sent: vec![] }
    }

    pub fn proof(&mut self, id: u16, bytes: &[u8]) -> Option<Frame> {
        let subject = Subject::of(id)?;
        let counter = &mut self.counters[subject.counter()];
        *counter += 1;
        let tag = self.key.tag(&self.session, *counter, id, bytes);
        let session = self.session.short();
        let proof = Authenticator { session, subject, counter: *counter as u8, tag }.encode(me());
        self.sent.push((proof, id, bytes.to_vec()));
        Some(proof)
    }
}

/// Begins a session; `None` if the controller refuses it.
pub fn session(rig: &mut Rig, nonce: u64) -> Option<LinkSession> {
    rig.send_message(&SessionRequest { nonce }.encode());
    let offer = SessionOffer::decode(rig.received()).ok()?;
    let session = LinkSession { number: offer.number, nonce };
    assert!(key().is_offer_tag(&offer.tag, &session, response_id(me())));
    Some(session)
}

/// Robot that has booted and requires the key, without a host that has a session.
fn requiring_key() -> Rig {
    let mut rig = Rig::booted();
    rig.brain.require_key(key(), Some(BOOT));
    rig.heartbeats_to = me();
    rig
}

fn with_host(mut rig: Rig) -> Rig {
    let session = session(&mut rig, NONCE).unwrap();
    rig.prover = Some(Prover::new(key(), session));
    rig
}

pub fn ready() -> Rig {
    let mut rig = with_host(requiring_key());
    rig.run(10);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    rig
}

/// Sends frames exactly as given, without authenticators of the rig, and returns the controller's answers.
pub fn send_raw(rig: &mut Rig, frames: &[Frame]) -> Vec<FromController> {
    let from = rig.heard.len();
    let prover = rig.prover.take();
    frames.iter().for_each(|frame| rig.send(frame));
    rig.prover = prover;
    rig.heard[from..].iter().map(|&(_, message)| message).collect()
}

fn results(heard: &[FromController]) -> Vec<CommandResult> {
    let acks = heard.iter().filter_map(|message| match message {
        FromController::CommandAck(ack) => Some(ack.result),
        _ => None,
    });
    acks.collect()
}

#[test]
fn with_the_key_everything_is_as_ever() {
    let mut rig = with_host(requiring_key());
    rig.run(10);
    assert_eq!(flash(&mut rig, &robot::library()), TransferResult::Ok);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    let kp = Parameter::Kp.code();
    let set = ParameterAction::Set { parameter: kp, channel: 0, value: 15.0 };
    assert_eq!(rig.parameter(set).result, ParameterResult::Ok);
    assert_eq!(rig.play(robot::CODE_WALK).result, CommandResult::Ok);
    rig.run(2000);
    assert_eq!(rig.brain.state(), State::Playing);
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
    rig.run_until(State::Disarmed, 3000);
    assert_eq!(rig.brain.unauthenticated_messages(), 0);
    assert_eq!(rig.prover.unwrap().session.number, u64::from(BOOT) << 32 | 1);
}

#[test]
fn without_the_key_nothing_is_obeyed_but_the_emergency_stop() {
    let mut rig = requiring_key();
    rig.host_alive = false;
    let command = rig.next_command(Action::ArmRequest).encode(me());
    assert_eq!(results(&send_raw(&mut rig, &[command])), [CommandResult::AuthenticationRequired]);
    let kp = Parameter::Kp.code();
    let set = ParameterAction::Set { parameter: kp, channel: 0, value: 15.0 };
    let ack = rig.parameter(set);
    assert_eq!((ack.result, ack.value), (ParameterResult::AuthenticationRequired, 0.0));
    let library = robot::library();
    for request in [
        Request::Begin { len: library.len() as u32, digest: 1 },
        Request::Block { offset: 0, bytes: &library[..64] },
        Request::Finish,
        Request::Activate { digest: 1 },
    ] {
        assert_eq!(result(rig.request(&request)), TransferResult::AuthenticationRequired);
    }
    assert!(rig.brain.library().is_some(), "it is not touched");
    assert_eq!(rig.brain.unauthenticated_messages(), 6);
    // Identity and journal are readable without authentication.
    let hello = Request::Hello { major: 2, minor: 0 };
    assert!(matches!(rig.request(&hello), Response::Hello(_)));
    assert!(matches!(rig.request(&Request::Log { since: 0 }), Response::Log(_)));
    let heard = send_raw(&mut rig, &[Discover.encode(me())]);
    assert!(matches!(heard[..], [FromController::Discovered(_)]));
    rig.estop();
    assert_eq!(rig.brain.state(), State::EStopped);
}

/// Set-points have no authenticator, so a controller with a key does not follow any, not even from its own host.
#[test]
fn no_stream_of_setpoints_is_followed() {
    let mut rig = with_host(requiring_key());
    rig.arm();
    rig.run_until(State::Ready, 1000);
    assert_eq!(rig.command(Action::Stream).result, CommandResult::Unproven);
    let track = Action::Track { rate_hz: 120, kp_percent: 10, kd_percent: 20 };
    assert_eq!(rig.command(track).result, CommandResult::Unproven);
    let setpoint = Setpoint {
        frame: 0,
        channel: 0,
        stiff: false,
        value: robot::STAND[0] + 0.1,
        torque_nm: 0.0,
    };
    rig.send(&setpoint.encode(me()));
    rig.run(30);
    assert_eq!(rig.brain.state(), State::Ready);
    assert!(rig.stands());
}

/// Refused messages neither advance the sequence of the host's commands nor use up its nonce.
#[test]
fn what_is_refused_leaves_the_host_s_commands_alone() {
    let mut rig = with_host(requiring_key());
    rig.run(10);
    let nonce = rig.command(Action::ArmRequest).value;
    let confirm = rig.next_command(Action::ArmConfirm { nonce });
    for seq in 0..16 {
        let command = Command { seq, action: Action::ArmConfirm { nonce }, ..confirm };
        let heard = send_raw(&mut rig, &[command.encode(me())]);
        assert_eq!(results(&heard), [CommandResult::AuthenticationRequired]);
    }
    let digest = 1;
    let prover = rig.prover.take();
    assert_eq!(
        result(rig.request(&Request::Activate { digest })),
        TransferResult::AuthenticationRequired
    );
    rig.prover = prover;
    assert_eq!(rig.repeat(confirm).result, CommandResult::Ok);
    assert_eq!(rig.brain.state(), State::Aligning);
}

#[test]
fn heartbeats_without_a_proof_are_answered_and_keep_no_robot_up() {
    let mut rig = ready();
    let prover = rig.prover.take();
    let from = rig.heard.len();
    rig.run_until(State::Returning, 60);
    assert!(rig.brain.faults().contains(Fault::HostLost));
    let answered = |(_, message): &&(u64, _)| matches!(message, FromController::HeartbeatReply(_));
    assert!(rig.heard[from..].iter().filter(answered).count() >= 4);
    // A heartbeat with a wrong proof gets no answer, so that the host notices.
    rig.prover = prover.map(|prover| Prover { key: LinkKey::new(&[1; 32]), ..prover });
    rig.run(10);
    let from = rig.heard.len();
    rig.run(60);
    assert_eq!(rig.heard[from..].iter().filter(answered).count(), 0);
}

#[test]
fn every_message_counts_once() {
    let mut rig = ready();
    rig.play(robot::CODE_WALK);
    rig.run(100);
    rig.command(Action::Return);
    let sent = rig.prover.as_ref().unwrap().sent.clone();
    let single =
        |(proof, id, bytes): &(Frame, u16, Vec<u8>)| Some([*proof, Frame::standard(*id, bytes)?]);
    let frames: Vec<[Frame; 2]> = sent.iter().filter_map(single).collect();
    assert!(frames.len() > 30);
    let before = rig.brain.unauthenticated_messages();
    for pair in &frames {
        let heard = send_raw(&mut rig, pair);
        let refused = heard.iter().all(|message| match message {
            FromController::CommandAck(ack) => ack.result == CommandResult::AuthenticationRequired,
            FromController::HeartbeatReply(_) => false,
            _ => true,
        });
        assert!(refused, "{heard:?}");
    }
    assert_eq!(rig.brain.unauthenticated_messages(), before + frames.len() as u32);
    // A proof is valid for one message and only once.
    let pause = rig.next_command(Action::Pause);
    let proof = rig.prover.as_mut().unwrap().proof(0x210, pause.encode(me()).data()).unwrap();
    let disarm = Command { action: Action::Disarm, ..pause }.encode(me());
    let refused = CommandResult::AuthenticationRequired;
    assert_eq!(results(&send_raw(&mut rig, &[proof, disarm])), [refused]);
    assert_eq!(results(&send_raw(&mut rig, &[disarm])), [refused]);
    assert_eq!(rig.command(Action::Return).result, CommandResult::Ok, "the host goes on");
}

#[test]
fn what_was_overtaken_is_refused() {
    let mut rig = with_host(requiring_key());
    rig.run(10);
    let [first, second] = [rig.next_command(Action::Disarm), rig.next_command(Action::Disarm)]
        .map(|command| command.encode(me()));
    let mut proof =
        |frame: &Frame| rig.prover.as_mut().unwrap().proof(0x210, frame.data()).unwrap();
    let (proof_1, proof_2) = (proof(&first), proof(&second));
    assert_eq!(results(&send_raw(&mut rig, &[proof_2, second])), [CommandResult::Ok]);
    let refused = [CommandResult::AuthenticationRequired];
    assert_eq!(results(&send_raw(&mut rig, &[proof_1, first])), refused);
    // Lost messages leave a gap. After more than 255 lost messages, the host begins another session.
    for (lost, expected) in [(254, CommandResult::Ok), (256, CommandResult::AuthenticationRequired)]
    {
        for _ in 0..lost {
            rig.prover.as_mut().unwrap().proof(0x210, &[]);
        }
        assert_eq!(rig.command(Action::Disarm).result, expected, "{lost} lost");
    }
}

#[test]
fn heartbeats_pass_between_the_frames_of_a_request() {
    let mut rig = with_host(requiring_key());
    let prover = rig.prover.as_mut().unwrap();
    let request = [0x13, 1, 2, 3, 4];
    let proof = prover.proof(0x510, &request).unwrap();
    rig.run(30);
    let heard = rig.heard.iter().any(|(_, m)| matches!(m, FromController::HeartbeatReply(_)));
    assert!(heard);
    let prover = rig.prover.take();
    rig.send(&proof);
    let Request::Activate { digest } = Request::decode(&request).unwrap() else { panic!() };
    assert_eq!(result(rig.request(&Request::Activate { digest })), TransferResult::NotFinished);
    rig.prover = prover;
}

#[test]
fn no_session_outlives_its_boot() {
    let mut rig = with_host(requiring_key());
    rig.run(10);
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
    let former = rig.prover.take().unwrap();
    let mut rig = rig.power_cycled(robot::config());
    rig.brain.require_key(key(), Some(BOOT + 1));
    // Same nonce and same count of sessions; only the boot differs.
    let session = session(&mut rig, NONCE).unwrap();
    assert_eq!(session.short(), former.session.short());
    for (proof, id, bytes) in &former.sent {
        if let Some(frame) = Frame::standard(*id, bytes) {
            send_raw(&mut rig, &[*proof, frame]);
        }
    }
    assert_eq!(rig.brain.unauthenticated_messages(), former.sent.len() as u32);
    rig.prover = Some(former);
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::AuthenticationRequired);
    rig.prover = Some(Prover::new(key(), session));
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
}

#[test]
fn sessions_end_by_silence_or_by_others_with_the_key() {
    let mut rig = requiring_key();
    rig.host_alive = false;
    let mut hosts: Vec<Prover> = (0..5)
        .map(|host| {
            rig.prover = Some(Prover::new(key(), session(&mut rig, host).unwrap()));
            assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
            rig.run(1);
            rig.prover.take().unwrap()
        })
        .collect();
    let ask = |rig: &mut Rig, host: &mut Prover| {
        rig.prover = Some(host.clone());
        let result = rig.command(Action::Disarm).result;
        *host = rig.prover.take().unwrap();
        result
    };
    // The fifth session replaced the session that had been silent for the longest time.
    let (first, others) = hosts.split_first_mut().unwrap();
    assert_eq!(ask(&mut rig, first), CommandResult::AuthenticationRequired);
    for host in &mut *others {
        assert_eq!(ask(&mut rig, host), CommandResult::Ok);
    }
    // Any number of requests ends no session.
    for nonce in 0..300 {
        session(&mut rig, 1000 + nonce).unwrap();
    }
    for host in &mut *others {
        assert_eq!(ask(&mut rig, host), CommandResult::Ok);
    }
    // Silence of 10 s.
    rig.run(10 * u32::from(rig.settings.control_hz) - 2);
    assert_eq!(ask(&mut rig, &mut others[0]), CommandResult::Ok);
    rig.run(4);
    assert_eq!(ask(&mut rig, &mut others[1]), CommandResult::AuthenticationRequired);
    assert_eq!(ask(&mut rig, &mut others[0]), CommandResult::Ok);
}

/// Authenticators name a session by its short number, of which there are sixteen.
#[test]
fn no_new_session_has_the_short_number_of_a_live_one() {
    let mut rig = requiring_key();
    let live = session(&mut rig, NONCE).unwrap();
    rig.prover = Some(Prover::new(key(), live));
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
    for nonce in 0..40 {
        let offered = session(&mut rig, 1000 + nonce).unwrap();
        assert_ne!(offered.short(), live.short(), "session {}", offered.number);
    }
}

#[test]
fn the_same_request_gets_the_same_session_until_it_is_used() {
    let mut rig = requiring_key();
    let first = session(&mut rig, NONCE).unwrap();
    assert_eq!(session(&mut rig, NONCE), Some(first));
    rig.prover = Some(Prover::new(key(), first));
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
    let second = session(&mut rig, NONCE).unwrap();
    assert_ne!(second.number, first.number);
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok, "the first one goes on");
}

#[test]
fn a_controller_that_cannot_count_its_boots_gives_no_session() {
    let mut rig = Rig::booted();
    rig.brain.require_key(key(), None);
    assert_eq!(session(&mut rig, NONCE), None);
    let Ok(Response::Reply(reply)) = Response::decode(rig.received()) else { panic!("a reply") };
    assert_eq!((reply.request, reply.result), (SessionRequest::KIND, TransferResult::StoreFailed));
    rig.estop();
    assert_eq!(rig.brain.state(), State::EStopped);
}

#[test]
fn a_controller_without_a_key_knows_no_sessions() {
    let mut rig = Rig::booted();
    assert_eq!(session(&mut rig, NONCE), None);
    let Ok(Response::Reply(reply)) = Response::decode(rig.received()) else { panic!("a reply") };
    assert_eq!(
        (reply.request, reply.result),
        (SessionRequest::KIND, TransferResult::UnknownRequest)
    );
}

#[test]
fn a_flood_leaves_the_log_readable() {
    let mut rig = requiring_key();
    rig.host_alive = false;
    for seq in 0..5000 {
        send_raw(&mut rig, &[Heartbeat { seq: seq as u8, host_ms: 0 }.encode(me())]);
    }
    let Response::Log(log) = rig.request(&Request::Log { since: 0 }) else { panic!("a log") };
    let refused = log.entries().filter(|(_, entry)| entry.event == Event::Unauthenticated.code());
    let counts: Vec<f32> = refused.map(|(_, entry)| entry.value).collect();
    assert_eq!(counts, [1.0, 16.0, 256.0, 4096.0]);
    assert_eq!(rig.brain.unauthenticated_messages(), 5000);
}
