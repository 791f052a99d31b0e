//! Invariants of an operator's host under any sequence of intents, received frames and losses.

use super::*;
use proptest::prelude::*;
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::wire::FromController;

/// Step of a random sequence.
#[derive(Clone, Debug)]
enum RandomStep {
    Intent(Intent),
    Frame(Frame),
    /// The latest command is answered.
    Answer(CommandResult, u16),
    Reply,
    Time(u64),
    BusLost,
    BusBack,
    /// The bus refuses the next command once.
    Full,
}

fn state() -> impl Strategy<Value = State> {
    prop::sample::select(State::ALL)
}

fn random_step() -> impl Strategy<Value = RandomStep> {
    let let_go = prop::sample::select(
        &[ReleaseReaction::Pause, ReleaseReaction::Return, ReleaseReaction::Disarm][..],
    );
    let deadman = prop_oneof![Just(Deadman::Held), let_go.prop_map(Deadman::Released)];
    let intent = prop_oneof![
        2 => Just(Intent::Arm),
        4 => (0u8..5).prop_map(|code| Intent::Play { code }),
        2 => Just(Intent::PauseOrResume),
        1 => Just(Intent::Pause),
        1 => Just(Intent::Return),
        1 => Just(Intent::Disarm),
        2 => Just(Intent::Estop),
        2 => Just(Intent::Clear),
        1 => any::<i8>().prop_map(|sixty_fourths| Intent::Speed { sixty_fourths }),
        2 => deadman.prop_map(Intent::Deadman),
    ];
    let status = (state(), any::<u16>(), any::<u8>(), 0u16..4096, 0u8..16).prop_map(
        |(state, faults, clip, frame, counter)| Status {
            state,
            severity: Severity::None,
            faults: FaultBits(faults),
            clip: Some(clip % 4),
            frame,
            counter,
            library: 0,
        },
    );
    let result = prop::sample::select(CommandResult::ALL);
    let other_ack = (0u8..16, 0u8..9, result.clone(), state(), any::<u16>()).prop_map(
        |(seq, kind, result, state, value)| {
            CommandAck { seq, kind, result, state, motion: None, value }.encode(node())
        },
    );
    let fault = (prop::sample::select(Fault::ALL), any::<f32>()).prop_map(|(fault, value)| {
        FaultReport { counter: 0, fault, channel: None, value }.encode(node())
    });
    let joint = any::<u8>().prop_map(|channel| {
        let (position_rad, velocity_rad_s, torque_nm) = (0.1, 0.2, 0.3);
        let status = ActuatorStatus(0);
        JointTelemetry { channel, position_rad, velocity_rad_s, torque_nm, status }.encode(node())
    });
    let any_frame = (0u16..0x800, prop::collection::vec(any::<u8>(), 0..=8))
        .prop_map(|(id, data)| Frame::standard(id, &data).unwrap());
    let frame = prop_oneof![
        4 => status.prop_map(|status| status.encode(node())),
        1 => state().prop_map(|state| EstopAck { state }.encode(node())),
        2 => other_ack,
        1 => fault,
        1 => joint,
        1 => any_frame,
    ];
    prop_oneof![
        6 => intent.prop_map(RandomStep::Intent),
        4 => frame.prop_map(RandomStep::Frame),
        4 => (prop_oneof![4 => Just(CommandResult::Ok), 1 => result], any::<u16>())
            .prop_map(|(result, value)| RandomStep::Answer(result, value)),
        2 => Just(RandomStep::Reply),
        4 => (0u64..400_000).prop_map(RandomStep::Time),
        1 => Just(RandomStep::BusLost),
        1 => Just(RandomStep::BusBack),
        1 => Just(RandomStep::Full),
    ]
}

/// Checks the invariants of all sent frames, in order.
#[derive(Default)]
struct InvariantCheck {
    /// Flags of clearing and arming since the latest stop was sent or received; `None` if there was no stop.
    since_stop: Option<(bool, bool)>,
    held: Option<bool>,
    /// Latest command.
    last: Option<Command>,
    /// Commands before the latest one.
    gone: Vec<Command>,
}

impl InvariantCheck {
    fn request(&mut self, intent: Intent) {
        match (intent, &mut self.since_stop) {
            (Intent::Estop, stop) => *stop = Some((false, false)),
            (Intent::Clear, Some((cleared, _))) => *cleared = true,
            (Intent::Arm, Some((true, armed))) => *armed = true,
            (Intent::Deadman(deadman), _) => self.held = Some(deadman == Deadman::Held),
            _ => {}
        }
    }

    fn sent(&mut self, message: &ToController) -> Result<(), TestCaseError> {
        let ToController::Command(command) = message else { return Ok(()) };
        let moves = matches!(command.action, Action::Play { .. } | Action::Resume);
        let arms = matches!(command.action, Action::ArmRequest | Action::ArmConfirm { .. });
        if moves {
            prop_assert!(self.since_stop.is_none_or(|wished| wished == (true, true)));
        }
        if arms {
            prop_assert!(self.since_stop.is_none_or(|(cleared, armed)| cleared && armed));
        }
        if moves || arms {
            prop_assert!(self.held != Some(false), "{command:?} without the deadman");
        }
        if let Action::Play { speed_64ths, .. } = command.action {
            prop_assert!((1..=64).contains(&speed_64ths));
        }
        if self.last != Some(*command) {
            prop_assert!(!self.gone.contains(command), "an old command once more");
            if let Some(last) = self.last.replace(*command) {
                // A new command has the next number. If a command was never sent, the number may be a few ahead.
                let ahead = command.seq.wrapping_sub(last.seq) & 0xF;
                prop_assert!((1..=8).contains(&ahead), "{:?} after {:?}", command, last);
                self.gone.push(last);
            }
            let recent = self.gone.len().saturating_sub(8);
            self.gone.drain(..recent);
        }
        Ok(())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn whatever_happens(all in prop::collection::vec(random_step(), 1..80)) {
        let mut desk = TestOperator::new();
        desk.operator.set_catalog(Some(catalog()));
        let mut watch = InvariantCheck::default();
        for happens in all {
            let before = desk.sent.len();
            match happens {
                RandomStep::Intent(intent) => {
                    watch.request(intent);
                    desk.request(intent);
                    let new = desk.poll();
                    if intent == Intent::Estop {
                        prop_assert_eq!(new.first(), Some(&ToController::Estop));
                    }
                }
                RandomStep::Frame(frame) => {
                    // A stop by another node of this controller also counts.
                    let heard = FromController::decode(&frame).ok().filter(|of| of.0 == node());
                    let stopped = match heard {
                        Some((_, FromController::Status(status))) => status.state == State::EStopped,
                        Some((_, FromController::EstopAck(_))) => true,
                        _ => false,
                    };
                    if stopped {
                        watch.since_stop = watch.since_stop.or(Some((false, false)));
                    }
                    desk.receive(frame);
                    desk.poll();
                }
                RandomStep::Answer(result, value) => {
                    if !desk.commands().is_empty() {
                        desk.answer(result, value);
                    }
                }
                RandomStep::Reply => desk.reply(),
                RandomStep::Time(us) => desk.pass(us),
                RandomStep::BusLost => desk.operator.on_bus_lost(desk.now_us, "unplugged"),
                RandomStep::BusBack => desk.operator.on_bus_back(desk.now_us),
                RandomStep::Full => desk.full = true,
            }
            for message in &desk.sent[before..] {
                watch.sent(message)?;
            }
            let _ = desk.operator.view(desk.now_us);
        }
    }
}
