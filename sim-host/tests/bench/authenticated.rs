//! Robot that requires a link key, and its hosts.

use crate::robot::{self, BOW, SWING};
use crate::{S, rig};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_bus::lossy::Lossy;
use rollwalk_firmware::Settings;
use rollwalk_host::authentication::{Credentials, NoSession, Peer};
use rollwalk_host::doctor::LinkKeyCheck;
use rollwalk_host::operator::{Intent, Operator};
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::authentication::{LINK_KEY_LEN, LinkKey};
use rollwalk_protocol::wire::{Action, CommandResult, Node, Parameter, ParameterResult, State};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::core::LocalController;
use rollwalk_sim_host::rig::Rig;
use rollwalk_sim_host::store::VerifyingKey;

fn node() -> Node {
    Node::new(1).unwrap()
}

fn peer(key: u8) -> Peer {
    let key = LinkKey::new(&[key; LINK_KEY_LEN]);
    Peer { node: node(), credentials: Some(Credentials { key, nonce: 0x0123_4567_89AB_CDEF }) }
}

fn requiring_key() -> Rig {
    let buses = robot::robot().controller_buses();
    let mut core = LocalController::new(robot::config(), buses, Settings::default());
    core.require_key(peer(1).credentials.unwrap().key, 0);
    Rig::with_core(&robot::robot(), core).unwrap()
}

fn refused(rig: &mut Rig) -> u32 {
    rig.core_mut().controller_mut().unauthenticated_messages()
}

fn from_flash_to_disarm<B: LinkBus>(bus: B) -> Session<B> {
    let mut session = Session::connect(bus, peer(1)).unwrap();
    session.flash(&robot::library(), |_| {}).unwrap();
    session.arm().unwrap();
    session.set_parameter(Parameter::Kp, 0, 45.0).unwrap();
    session.select(SWING).unwrap();
    session.run_for(3 * S).unwrap();
    session.return_to_safe().unwrap();
    session.disarm().unwrap();
    session
}

/// Public key of RFC 8032, section 7.1, test 1.
const OWNER: [u8; 32] = [
    0xd7, 0x5a, 0x98, 0x01, 0x82, 0xb1, 0x0a, 0xb7, 0xd5, 0x4b, 0xfe, 0xd3, 0xc9, 0x64, 0x07, 0x3a,
    0x0e, 0xe1, 0x72, 0xf3, 0xda, 0xa6, 0x23, 0x25, 0xaf, 0x02, 0x1a, 0x68, 0xf7, 0x07, 0x51, 0x1a,
];

/// Set-points are not signed. A robot that plays only its owner's libraries therefore refuses streams of set-points.
#[test]
fn a_robot_with_a_library_key_follows_no_stream() {
    let buses = robot::robot().controller_buses();
    let core = LocalController::new(robot::config(), buses, Settings::default())
        .with_library_key(VerifyingKey::from_bytes(&OWNER).unwrap());
    let rig = Rig::with_core(&robot::robot(), core).unwrap();
    let mut session = Session::connect(rig, Peer { node: node(), credentials: None }).unwrap();
    let track = Action::Track { rate_hz: 120, kp_percent: 10, kd_percent: 20 };
    for action in [Action::Stream, track] {
        let refused = session.command("follow", action);
        let is_unproven =
            matches!(refused, Err(SessionError::Refused { result: CommandResult::Unproven, .. }));
        assert!(is_unproven, "{action:?}: {refused:?}");
    }
}

#[test]
fn with_the_key_all_works_and_nothing_is_refused() {
    let mut rig = from_flash_to_disarm(requiring_key()).into_bus();
    assert_eq!(refused(&mut rig), 0);
    // The next host, after the next boot.
    let mut session = Session::connect(rig.power_cycled(), peer(1)).unwrap();
    session.run_for(S).unwrap();
    session.arm().unwrap();
}

#[test]
fn on_a_bad_link_as_well() {
    for seed in 0..3 {
        from_flash_to_disarm(Lossy::new(requiring_key(), 30, seed));
    }
}

#[test]
fn without_the_key_the_error_says_what_to_do() {
    let mut session = Session::connect(requiring_key(), node()).unwrap();
    let text = "authentication required; give the robot's link key with --link-key FILE or ROLLWALK_LINK_KEY \
                (emergency stops require none)";
    let error = session.arm().unwrap_err();
    let result = CommandResult::AuthenticationRequired;
    assert!(matches!(error, SessionError::Refused { result: found, .. } if found == result));
    assert_eq!(error.to_string(), format!("the controller refused to arm: {text}"));
    let error = session.flash(&robot::library(), |_| {}).unwrap_err();
    assert_eq!(error.to_string(), format!("the controller refused the library: {text}"));
    let error = session.set_parameter(Parameter::Kp, 0, 45.0).unwrap_err();
    let required = ParameterResult::AuthenticationRequired;
    assert!(
        matches!(error, SessionError::ParameterRefused { result, .. } if result == required),
        "{error}"
    );
    session.estop().unwrap();
}

#[test]
fn a_wrong_key_and_a_needless_one_are_told_from_a_silent_robot() {
    let error = Session::connect(requiring_key(), peer(2)).err().unwrap();
    assert_eq!(error, SessionError::NoSession { node: 1, why: NoSession::WrongKey });
    assert!(error.to_string().contains("has another link key"), "{error}");
    let error = Session::connect(rig(), peer(1)).err().unwrap();
    assert_eq!(error, SessionError::NoSession { node: 1, why: NoSession::NotNeeded });
    let absent = Peer { node: Node::new(7).unwrap(), ..peer(1) };
    let error = Session::connect(requiring_key(), absent).err().unwrap();
    assert!(matches!(error, SessionError::Silent { what: "session", .. }), "{error}");
}

/// The check begins no session, so a host that has one keeps it.
#[test]
fn a_diagnosis_finds_out_whether_a_key_is_missing() {
    let without = || Peer::from(node());
    for (mut rig, peer, expected) in [
        (rig(), without(), LinkKeyCheck::NotNeeded),
        (rig(), peer(1), LinkKeyCheck::GivenInVain),
        (requiring_key(), without(), LinkKeyCheck::Missing),
        (requiring_key(), peer(1), LinkKeyCheck::Accepted),
        (requiring_key(), peer(2), LinkKeyCheck::Wrong),
    ] {
        assert_eq!(LinkKeyCheck::of(&mut rig, &peer).0, expected);
        assert_eq!(refused(&mut rig), 0);
    }
    let mut session = Session::connect(requiring_key(), peer(1)).unwrap();
    assert_eq!(LinkKeyCheck::of(session.bus_mut(), &node().into()).0, LinkKeyCheck::Missing);
    session.estop().unwrap();
    session.run_for(S / 10).unwrap();
    session.clear().unwrap();
    assert_eq!(refused(session.bus_mut()), 0);
}

/// Robot whose controller can be restarted while its host is connected.
struct Restarted(Option<Rig>);

impl Restarted {
    fn rig(&mut self) -> &mut Rig {
        self.0.as_mut().unwrap()
    }

    fn restart(&mut self) {
        let mut rig = self.0.take().unwrap().power_cycled();
        // Time for the self test.
        rig.run_until(SimTime::from_us(rig.now_us() + S / 10));
        self.0 = Some(rig);
    }
}

impl LinkBus for Restarted {
    fn now_us(&self) -> u64 {
        self.0.as_ref().unwrap().now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.rig().send(frame)
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        self.rig().receive(deadline_us)
    }
}

#[test]
fn after_a_restart_of_the_robot_its_host_begins_another_session_by_itself() {
    let mut session = from_flash_to_disarm(Restarted(Some(requiring_key())));
    session.bus_mut().restart();
    // A host with heartbeats notices by them; a host without notices at its command.
    session.run_for(S).unwrap();
    session.arm().unwrap();
    session.bus_mut().restart();
    session.arm().unwrap();
    session.bus_mut().restart();
    session.flash(&robot::library(), |_| {}).unwrap();
    session.bus_mut().restart();
    session.set_parameter(Parameter::Kp, 0, 45.0).unwrap();
}

#[test]
fn a_visitor_with_the_key_commands_beside_the_host() {
    let mut session = Session::connect(requiring_key(), peer(1)).unwrap();
    session.flash(&robot::library(), |_| {}).unwrap();
    session.arm().unwrap();
    session.run_for(S).unwrap();
    let visited = Peer {
        credentials: peer(1).credentials.map(|own| Credentials { nonce: 77, ..own }),
        ..peer(1)
    };
    let mut visitor = Session::visit(session.into_bus(), visited).unwrap();
    visitor.set_parameter(Parameter::Kp, 0, 50.0).unwrap();
    assert_eq!(visitor.parameter(Parameter::Kp, 0).unwrap(), 50.0);
}

/// Runs an operator on the simulated link for `us` microseconds.
fn run(operator: &mut Operator, rig: &mut Rig, us: u64) {
    let until_us = rig.now_us() + us;
    while rig.now_us() < until_us {
        let now_us = rig.now_us();
        while let Some(frame) = operator.poll(now_us) {
            if rig.send(&frame).is_err() {
                operator.not_sent(frame);
                break;
            }
        }
        if let Some(frame) = rig.receive(operator.next_poll_us(now_us).min(until_us)).unwrap() {
            operator.on_frame(rig.now_us(), &frame);
        }
    }
}

#[test]
fn a_console_with_the_key_plays_and_outlives_a_restart() {
    let mut rig = from_flash_to_disarm(requiring_key()).into_bus();
    let mut operator = Operator::new(peer(1), Some(robot::config().hash()));
    let state = |operator: &Operator, rig: &Rig| operator.view(rig.now_us()).status.unwrap().state;
    for _ in 0..2 {
        run(&mut operator, &mut rig, 2 * S);
        operator.request(rig.now_us(), Intent::Arm);
        run(&mut operator, &mut rig, 4 * S);
        assert_eq!(state(&operator, &rig), State::Ready);
        operator.request(rig.now_us(), Intent::Play { code: BOW });
        run(&mut operator, &mut rig, S);
        assert_eq!(state(&operator, &rig), State::Playing);
        rig = rig.power_cycled();
    }
}

#[test]
fn a_console_says_that_its_key_is_wrong_and_can_still_stop() {
    let mut rig = requiring_key();
    let mut operator = Operator::new(peer(2), None);
    run(&mut operator, &mut rig, 2 * S);
    let told = |operator: &Operator, what: &str| {
        let messages = operator.view(0).messages;
        messages.iter().filter(|message| message.text.contains(what)).count()
    };
    assert_eq!(told(&operator, "has another link key"), 1);
    operator.request(rig.now_us(), Intent::Estop);
    run(&mut operator, &mut rig, S);
    assert_eq!(operator.view(rig.now_us()).status.unwrap().state, State::EStopped);
}
