//! Tests of emergency stops, silent hosts and absent controllers.

use crate::robot::SWING;
use crate::{S, armed, connect, rig};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_bus::lossy::Lossy;
use rollwalk_host::describe::event_sentence;
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::{Event, Fault};
use rollwalk_protocol::wire::{Estop, EstopAck, Node, State};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::rig::Rig;

#[test]
fn an_emergency_stop_takes_torque_off_and_stays_until_cleared() {
    let mut session = armed();
    session.select(SWING).unwrap();
    session.run_for(2 * S).unwrap();
    session.estop().unwrap();
    let stopped = session.bus().now();
    session.run_for(S).unwrap();
    assert_eq!(session.status().unwrap().state, State::EStopped);
    assert!(session.status().unwrap().faults.contains(Fault::EStop));
    let played_later =
        session.bus().records().iter().any(|record| record.time_us > stopped.as_us() + 10_000);
    assert!(!played_later);

    let error = session.arm().unwrap_err();
    assert!(error.to_string().starts_with("the controller refused to arm:"), "{error}");
    session.clear().unwrap();
    session.arm().unwrap();
}

#[test]
fn an_emergency_stop_overtakes_everything_that_waits_for_the_link() {
    let mut rig = armed().into_bus();
    let node = Node::new(1).unwrap();
    // A node floods the link with frames of the lowest priority.
    let flood = Frame::standard(0x7FF, &[0; 8]).unwrap();
    while rig.send(&flood).is_ok() {}
    // The flood also fills the host's own queue; the stop gets the first free place.
    while rig.send(&Estop.encode(node)).is_err() {
        rig.run_until(rig.now() + SimTime::from_us(10));
    }
    let posted = rig.now();
    let mut answer = None;
    while answer.is_none() {
        let frame = rig.receive(rig.now_us() + 10_000).unwrap().expect("an answer within 10 ms");
        answer = EstopAck::decode(&frame).ok();
    }
    assert_eq!(answer.unwrap().1.state, State::EStopped);
    // One frame of the flood in transmission, the stop, one frame in the controller's transmit buffer, and the answer, each of
    // at most 135 bits. The rest of the flood waits.
    assert!(rig.now() - posted < SimTime::from_us(4 * 135), "{:?}", rig.now() - posted);
}

/// Link that accepts no frame while `full`, and records the frames that it accepted.
struct FullLink {
    rig: Rig,
    full: bool,
    taken: Vec<Frame>,
}

impl LinkBus for FullLink {
    fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        if self.full {
            return Err(LinkError::Busy);
        }
        self.taken.push(*frame);
        self.rig.send(frame)
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        self.rig.receive(deadline_us)
    }
}

#[test]
fn what_the_link_did_not_take_does_not_come_before_an_emergency_stop() {
    let rig = armed().into_bus();
    let mut session = connect(FullLink { rig, full: false, taken: Vec::new() });
    session.bus_mut().full = true;
    assert!(matches!(session.select(SWING), Err(SessionError::Silent { .. })));
    (session.bus_mut().full, session.bus_mut().taken) = (false, Vec::new());
    session.estop().unwrap();
    let node = session.bus().rig.node();
    assert_eq!(session.bus().taken.first(), Some(&Estop.encode(node)));
}

#[test]
fn waiting_for_what_will_not_come_ends_with_the_reason() {
    let mut session = armed();
    session.estop().unwrap();
    let error = session.wait_for_state(State::Ready, 5 * S).unwrap_err();
    let sentence = error.to_string();
    assert!(sentence.contains("is stopped by an emergency stop"), "{sentence}");
    session.clear().unwrap();
    let error = session.wait_for_state(State::Ready, S).unwrap_err();
    let sentence = error.to_string();
    assert!(sentence.starts_with("waited 1 s for the robot to be ready"), "{sentence}");
    assert!(sentence.contains("still disarmed"), "{sentence}");
}

#[test]
fn a_silent_host_lets_the_robot_return_to_safe_and_lie_down() {
    let mut session = armed();
    session.select(SWING).unwrap();
    session.run_for(2 * S).unwrap();
    let mut rig = session.into_bus();
    rig.run_until(rig.now() + SimTime::from_ms(8_000));

    let mut clips: Vec<u8> = rig.records().iter().map(|record| record.clip.0).collect();
    clips.dedup();
    assert_eq!(clips, [0, 4, 1, 5, 0], "by the transition, not straight");
    let quiet_since = SimTime::from_us(rig.records().last().unwrap().time_us);
    assert!(rig.now() - quiet_since > SimTime::from_ms(1_000), "no torque for a while");

    let mut session = connect(rig);
    session.run_for(200_000).unwrap();
    let status = session.status().unwrap();
    assert_eq!(status.state, State::TorqueOff);
    assert!(status.faults.contains(Fault::HostLost));
    // Torque is off, but Disarmed does not follow automatically, so waiting is useless.
    let error = session.disarm().unwrap_err();
    assert!(matches!(error, SessionError::WentElsewhere { .. }), "{error}");
    session.clear().unwrap();
    session.arm().unwrap();
}

#[test]
fn a_controller_that_is_not_there_is_named() {
    let error = Session::connect(rig(), Node::new(7).unwrap()).err().unwrap();
    assert!(matches!(error, SessionError::Silent { node: 7, what: "heartbeat", .. }));
    assert_eq!(
        error.to_string(),
        "controller 7 does not answer (heartbeat): controller 1 is on this bus; to use it, give --node 1"
    );
}

#[test]
fn waiting_on_the_simulated_link_lets_exactly_that_time_pass() {
    let mut rig = rig();
    let mut frames = 0;
    while rig.receive(S).unwrap().is_some() {
        frames += 1;
    }
    assert_eq!(rig.now_us(), S);
    assert!(frames > 0, "a controller reports its status unasked");
}

#[test]
fn who_connects_later_is_told_why_the_robot_stopped() {
    let mut session = armed();
    session.select(SWING).unwrap();
    session.run_for(2 * S).unwrap();
    let mut rig = session.into_bus();
    // No host is connected for a minute.
    rig.run_until(rig.now() + SimTime::from_us(60 * S));

    // A bad link does not help either.
    let mut session = connect(Lossy::new(rig, 50, 7));
    let history = session.history().unwrap();
    assert!(session.bus().lost() > 0);
    let why = *history.last_stop().expect("a stop");
    assert_eq!(Event::from_code(why.event), Some(Event::HostLost));
    assert_eq!((why.before, why.after), (State::Playing, State::Returning));
    assert_eq!(why.fault, Some(Fault::HostLost));
    assert!((0.25..0.3).contains(&why.value), "{why:?}");
    assert!((59_000..60_000).contains(&history.age_ms(&why)), "{history:?}");
    assert!(event_sentence(why.event).contains("heartbeat"));
    assert_eq!(history.entries.last().map(|(_, entry)| entry.after), Some(State::TorqueOff));
}
