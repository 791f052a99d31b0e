//! Attacks on a controller that requires a link key, by a node that receives all frames and has no key.
//!
//! Two robots receive the same messages of a host. Random attacks between these messages are sent to one of the robots, and
//! both must behave alike. The campaign of `cargo xtask nightly` counts the attacks.

use crate::authentication::{BOOT, NONCE, Prover, key, ready, send_raw, session};
use crate::rig::{Rig, me};
use crate::robot;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::authentication::*;
use rollwalk_protocol::wire::{
    Action, Command, CommandResult, FromController, Node, ParameterAction, ParameterRequest,
    ParameterResult, State, Torque,
};
use std::collections::BTreeMap;
use std::println;

/// Number of attacks in a case.
const ATTACKS: usize = 60;
/// Number of cases of the campaign, each with its own seed.
const CASES: u64 = 2000;

/// Message that an attacking node may send.
#[derive(Clone, Debug)]
enum Attack {
    /// An unchanged copy of a message and its authenticator.
    Replay {
        back: usize,
    },
    /// A message with the authenticator of another message.
    Mix {
        back: usize,
        other: usize,
    },
    /// A message with one bit flipped in the message or its authenticator.
    Forge {
        back: usize,
        bit: usize,
    },
    /// A message that is truncated, or whose authenticator is.
    Cut {
        back: usize,
        len: usize,
        message: bool,
    },
    /// A message with a random tag.
    Guess {
        proof: [u8; 8],
        command: u8,
    },
    Plain {
        back: usize,
    },
    /// A command that arrives after the host's next command.
    Overtaken {
        action: Action,
    },
    /// A command of another session with the same key: of an earlier or later boot, of another host, or to another robot.
    OtherSession {
        which: OtherSession,
        counter: u32,
    },
    /// A request for a session that no host uses.
    Session {
        nonce: u64,
    },
}

/// Property in which the other session differs.
#[derive(Clone, Copy, Debug)]
enum OtherSession {
    Boot,
    Number,
    Host,
    Robot,
}

impl Attack {
    fn name(&self) -> &'static str {
        match self {
            Self::Replay { .. } => "replayed",
            Self::Mix { .. } => "with another's authenticator",
            Self::Forge { .. } => "forged",
            Self::Cut { .. } => "cut",
            Self::Guess { .. } => "guessed",
            Self::Plain { .. } => "without authenticator",
            Self::Overtaken { .. } => "reordered",
            Self::OtherSession { .. } => "of another session",
            Self::Session { .. } => "requests of a session",
        }
    }
}

fn attack() -> impl Strategy<Value = Attack> {
    let back = || 0usize..64;
    let action = prop_oneof![
        Just(Action::Disarm),
        Just(Action::Pause),
        Just(Action::Return),
        Just(Action::Play { code: robot::CODE_WALK, speed_64ths: 64 }),
    ];
    let session = prop_oneof![
        Just(OtherSession::Boot),
        Just(OtherSession::Number),
        Just(OtherSession::Host),
        Just(OtherSession::Robot),
    ];
    prop_oneof![
        back().prop_map(|back| Attack::Replay { back }),
        (back(), back()).prop_map(|(back, other)| Attack::Mix { back, other }),
        (back(), 0usize..128).prop_map(|(back, bit)| Attack::Forge { back, bit }),
        (back(), 0usize..8, any::<bool>()).prop_map(|(back, len, message)| Attack::Cut {
            back,
            len,
            message
        }),
        (any::<[u8; 8]>(), any::<u8>())
            .prop_map(|(proof, command)| Attack::Guess { proof, command }),
        back().prop_map(|back| Attack::Plain { back }),
        action.prop_map(|action| Attack::Overtaken { action }),
        (session, 1u32..600).prop_map(|(which, counter)| Attack::OtherSession { which, counter }),
        prop_oneof![Just(NONCE), any::<u64>()].prop_map(|nonce| Attack::Session { nonce }),
    ]
}

/// Test case: attacks with the number of ticks after each, the host's commands, and the index of the attack before which the
/// power fails.
type Case = (Vec<(u32, Attack)>, Vec<u8>, usize);

fn case() -> impl Strategy<Value = Case> {
    (
        proptest::collection::vec((0u32..6, attack()), ATTACKS),
        proptest::collection::vec(0u8..5, ATTACKS),
        // Some cases have no other session.
        0usize..3 * ATTACKS,
    )
}

/// Frame with the same identifier and other bytes.
fn with(frame: &Frame, bytes: &[u8]) -> Frame {
    Frame::standard(frame.standard_id().unwrap(), bytes).unwrap()
}

fn flipped(frame: &Frame, bit: usize) -> Frame {
    let mut data = frame.data().to_vec();
    let bit = bit % (8 * data.len());
    data[bit / 8] ^= 1 << (bit % 8);
    with(frame, &data)
}

fn cut(frame: &Frame, len: usize) -> Frame {
    with(frame, &frame.data()[..len % frame.data().len()])
}

/// Command as the host would send it at the current time.
fn command_now(rig: &Rig, seq: u8, action: Action) -> Command {
    let valid_until_ms = ((rig.now_us / 1000) as u16).wrapping_add(400);
    Command { seq: seq & 0xF, action, valid_until_ms }
}

/// Frames of an attack; `None` if the attack is a request for a session, which is not a single frame.
fn frames(rig: &mut Rig, attack: &Attack) -> Option<Vec<Frame>> {
    let now = |seq: u8, action| command_now(rig, seq, action);
    let play = |code| Action::Play { code, speed_64ths: 64 };
    let prover = rig.prover.as_ref()?;
    let former = |back: usize| {
        let single = |(proof, id, bytes): &(Frame, u16, Vec<u8>)| {
            Some([*proof, Frame::standard(*id, bytes)?])
        };
        prover.sent.iter().rev().nth(back % prover.sent.len()).and_then(single)
    };
    let both = match *attack {
        Attack::Replay { back } => former(back)?,
        Attack::Mix { back, other } => [former(other)?[0], former(back)?[1]],
        Attack::Forge { back, bit } => {
            let [proof, message] = former(back)?;
            match bit < 64 {
                true => [flipped(&proof, bit), message],
                false => [proof, flipped(&message, bit)],
            }
        }
        Attack::Cut { back, len, message } => {
            let [proof, whole] = former(back)?;
            if message { [proof, cut(&whole, len)] } else { [cut(&proof, len), whole] }
        }
        Attack::Guess { proof, command } => {
            let command = now(command, play(command)).encode(me());
            [Frame::standard(0x012, &proof).unwrap(), command]
        }
        Attack::Plain { back } => return Some(vec![former(back)?[1]]),
        Attack::OtherSession { which, counter } => {
            let own = prover.session;
            let (number, nonce) = (own.number, own.nonce);
            let (session, to) = match which {
                OtherSession::Boot => {
                    (LinkSession { number: number ^ 1 << (32 + counter % 32), nonce }, me())
                }
                // A session with the same short number.
                OtherSession::Number => {
                    (LinkSession { number: number ^ 1 << (4 + counter % 28), nonce }, me())
                }
                OtherSession::Host => {
                    (LinkSession { number, nonce: nonce ^ 1 << (counter % 64) }, me())
                }
                OtherSession::Robot => (own, Node::new(me().number() ^ 2).unwrap()),
            };
            let message = now(counter as u8, play(robot::CODE_DRIVE));
            // The expected counter, and counters near it.
            let counter = prover.counters[Subject::Command.counter()].wrapping_add(counter % 8);
            let theirs = message.encode(to);
            let (id, message) = (theirs.standard_id().unwrap(), message.encode(me()));
            let tag = key().tag(&session, counter, id, theirs.data());
            let (session, subject, counter) = (session.short(), Subject::Command, counter as u8);
            [Authenticator { session, subject, counter, tag }.encode(me()), message]
        }
        Attack::Overtaken { .. } | Attack::Session { .. } => return None,
    };
    Some(both.to_vec())
}

/// Carries out an attack; returns true if the robot executed a command of the attacker.
fn attacked(rig: &mut Rig, attack: &Attack, held: &mut Option<[Frame; 2]>) -> bool {
    let mut heard = match held.take() {
        Some(held) => send_raw(rig, &held),
        None => vec![],
    };
    if let Some(frames) = frames(rig, attack) {
        heard.extend(send_raw(rig, &frames));
    }
    match *attack {
        Attack::Session { nonce } => rig.send_message(&SessionRequest { nonce }.encode()),
        Attack::Overtaken { action } => {
            let message = rig.next_command(action).encode(me());
            let (id, prover) = (message.standard_id().unwrap(), rig.prover.as_mut().unwrap());
            *held = prover.proof(id, message.data()).map(|proof| [proof, message]);
        }
        _ => {}
    }
    // Values that the controller keeps are not the host's.
    let request = ParameterRequest { seq: 3, action: ParameterAction::Reset };
    heard.extend(send_raw(rig, &[request.encode(me())]));
    heard.iter().any(|answer| match answer {
        FromController::CommandAck(ack) => ack.result != CommandResult::AuthenticationRequired,
        FromController::ParameterAck(ack) => ack.result != ParameterResult::AuthenticationRequired,
        _ => false,
    })
}

/// Restarts the robot. The host begins its next session, and the attacker still has all messages of the previous one.
fn power_cycled(rig: Rig, boot: u32) -> Rig {
    let mut rig = rig.power_cycled(robot::config());
    rig.brain.require_key(key(), Some(boot));
    let sent = rig.prover.take().unwrap().sent;
    let session = session(&mut rig, NONCE).unwrap();
    let mut prover = Prover::new(key(), session);
    prover.sent = sent;
    rig.prover = Some(prover);
    rig.run(10);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    rig
}

/// Runs two robots with the same host, and attacks one of them between the host's messages. Returns the number of refused
/// messages.
///
/// # Errors
///
/// Returns a description if an attack succeeds or the robots differ.
fn attacks_have_no_effect((attacks, commands, cut_at): &Case) -> Result<u32, String> {
    let (mut left_alone, mut victim) = (ready(), ready());
    let (mut held, mut refused) = (None, 0);
    for (number, ((ticks, attack), command)) in attacks.iter().zip(commands).enumerate() {
        if number == *cut_at {
            refused += victim.brain.unauthenticated_messages();
            left_alone = power_cycled(left_alone, BOOT + 1);
            victim = power_cycled(victim, BOOT + 1);
        }
        if attacked(&mut victim, attack, &mut held) {
            return Err(format!("attack {number}, {attack:?}, was obeyed"));
        }
        for rig in [&mut left_alone, &mut victim] {
            let action = match command {
                0 => Action::Play { code: robot::CODE_WALK, speed_64ths: 64 },
                1 => Action::Play { code: robot::CODE_DRIVE, speed_64ths: 40 },
                2 => Action::Return,
                3 => Action::Pause,
                _ => Action::Resume,
            };
            rig.command(action);
            rig.run(*ticks);
        }
        let seen = |rig: &Rig| {
            let setpoints: Vec<_> = rig.servos.iter().map(|s| s.setpoints.clone()).collect();
            (rig.brain.state(), rig.brain.playing(), rig.brain.faults(), setpoints)
        };
        if seen(&left_alone) != seen(&victim) {
            return Err(format!("the robots differ after attack {number}, {attack:?}"));
        }
        if victim.brain.state().torque() == Torque::Off {
            return Err(format!("attack {number}, {attack:?}, took the torque away"));
        }
    }
    let own = left_alone.brain.unauthenticated_messages();
    if own != 0 {
        return Err(format!("{own} messages of the host were refused"));
    }
    Ok(refused + victim.brain.unauthenticated_messages())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_robot_that_is_attacked_does_what_one_that_is_left_alone_does(case in case()) {
        let refused = attacks_have_no_effect(&case).map_err(TestCaseError::fail)?;
        prop_assert!(refused as usize >= ATTACKS);
    }
}

/// Campaign of `cargo xtask nightly --only hostile`: thousands of cases, with the same seeds every night.
#[test]
#[ignore = "cargo xtask nightly --only hostile"]
fn campaign() {
    let (mut counts, mut refused, mut violations) = (BTreeMap::new(), 0, 0);
    for seed in 0..CASES {
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&seed.to_le_bytes());
        let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &bytes);
        let mut runner = TestRunner::new_with_rng(ProptestConfig::default(), rng);
        let case = case().new_tree(&mut runner).unwrap().current();
        case.0.iter().for_each(|(_, attack)| *counts.entry(attack.name()).or_insert(0) += 1);
        match attacks_have_no_effect(&case) {
            Ok(count) => refused += count,
            Err(violation) => {
                println!("seed {seed}: {violation}");
                violations += 1;
            }
        }
    }
    println!("{CASES} seeds, {} attacks:", counts.values().sum::<u32>());
    counts.iter().for_each(|(name, count)| println!("{count:>8} {name}"));
    println!("{refused} messages refused, {violations} violations");
    assert_eq!(violations, 0);
}
