//! Arbitrary sequences of commands, garbage, losses and time. The controller does not panic, and can always return to SAFE or
//! torque off. The test rig checks every frame: set-points stay within the limits, and stop while torque is off.

use proptest::prelude::*;

use rollwalk_protocol::actuator::{ActuatorStatus, Feedback};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::{Action, ParameterAction, Setpoint, State};

use crate::rig::Rig;
use crate::robot::*;
use crate::stimuli::{Stimulus, act, assert_way_home};

fn frame() -> impl Strategy<Value = Frame> {
    let any_id = 0u16..0x800;
    // Mostly identifiers of messages to the controller.
    let known = prop::sample::select(vec![
        0x010u16, 0x0F0, 0x110, 0x1F0, 0x210, 0x411, 0x510, 0x610, 0x710, 0x7F0,
    ]);
    (prop_oneof![any_id, known], prop::collection::vec(any::<u8>(), 0..=8))
        .prop_map(|(id, data)| Frame::standard(id, &data).unwrap())
}

/// Feedback with arbitrary measurements and status, in a frame that decodes.
fn feedback() -> impl Strategy<Value = (u8, Frame)> {
    let measured = (-7.0f32..7.0, -70.0f32..70.0, any::<u8>(), any::<u8>());
    (0u8..3, 1u8..3, measured).prop_map(
        |(bus, id, (position_rad, velocity_rad_s, status, counter))| {
            let status = ActuatorStatus(status);
            let feedback =
                Feedback { position_rad, velocity_rad_s, torque_nm: 0.0, status, counter };
            (bus, feedback.encode(id).unwrap())
        },
    )
}

fn action() -> impl Strategy<Value = Action> {
    let code = prop_oneof![Just(CODE_STAND), Just(CODE_DRIVE), Just(CODE_WALK), any::<u8>()];
    prop_oneof![
        6 => code.prop_map(|code| Action::Play { code, speed_64ths: 64 }),
        1 => any::<i8>().prop_map(|speed_64ths| Action::Play { code: CODE_WALK, speed_64ths }),
        1 => Just(Action::Pause),
        1 => Just(Action::Return),
        1 => Just(Action::Disarm),
        3 => Just(Action::Stream),
        3 => (15u16..125, 0u8..102, 0u8..102).prop_map(|(rate_hz, kp_percent, kd_percent)| {
            Action::Track { rate_hz, kp_percent, kd_percent }
        }),
        1 => any::<u16>().prop_map(|nonce| Action::ArmConfirm { nonce }),
        1 => any::<u16>().prop_map(|nonce| Action::ClearConfirm { nonce }),
        1 => (11u8..16).prop_map(|kind| Action::Unknown { kind }),
    ]
}

/// Requests with allowed values, forbidden values, and NaN.
fn parameter() -> impl Strategy<Value = ParameterAction> {
    let value = prop_oneof![
        -1.0f32..45.0,
        0.0f32..1.5,
        any::<u32>().prop_map(f32::from_bits),
        Just(f32::NAN),
        Just(f32::INFINITY),
    ];
    prop_oneof![
        8 => (0u8..4, 0u8..4, value)
            .prop_map(|(parameter, channel, value)| ParameterAction::Set { parameter, channel, value }),
        1 => (0u8..16, any::<u8>())
            .prop_map(|(parameter, channel)| ParameterAction::Get { parameter, channel }),
        1 => Just(ParameterAction::Reset),
        1 => Just(ParameterAction::Save),
        1 => (5u8..16).prop_map(|kind| ParameterAction::Unknown { kind }),
    ]
}

/// Actions and events with truthful actuators.
fn honest() -> impl Strategy<Value = Stimulus> {
    prop_oneof![
        12 => (1u16..250).prop_map(Stimulus::Run),
        6 => action().prop_map(Stimulus::Command),
        3 => parameter().prop_map(Stimulus::Parameter),
        5 => Just(Stimulus::Arm),
        2 => Just(Stimulus::Clear),
        2 => (0u8..8).prop_map(Stimulus::Replay),
        2 => frame().prop_map(Stimulus::Link),
        1 => prop::collection::vec(any::<u8>(), 1..40).prop_map(Stimulus::Transfer),
        1 => any::<u32>().prop_map(Stimulus::Begin),
        1 => Just(Stimulus::Flash),
        1 => any::<bool>().prop_map(Stimulus::Host),
        1 => any::<bool>().prop_map(Stimulus::Buses),
        1 => (0usize..3, any::<bool>()).prop_map(|(i, on)| Stimulus::Power(i, on)),
        1 => (0usize..3, any::<u8>()).prop_map(|(i, s)| Stimulus::Status(i, s & ActuatorStatus::FAULTS)),
        1 => Just(Stimulus::Estop),
        1 => Just(Stimulus::Board),
        4 => (any::<u8>(), setpoint()).prop_map(|(frames, first)| Stimulus::Setpoints(frames / 3, first)),
        4 => (any::<u8>(), setpoint()).prop_map(|(samples, with)| Stimulus::Answers(samples / 3, with)),
    ]
}

/// Set-point near SAFE, where a stream begins, or with any value.
fn setpoint() -> impl Strategy<Value = Setpoint> {
    let value = prop_oneof![3 => -0.7f32..0.5, 1 => -900.0f32..900.0];
    let frame = prop_oneof![2 => Just(0u8), 1 => any::<u8>()];
    let of = (frame, 0u8..4, any::<bool>());
    (of, value, -200.0f32..200.0).prop_map(|((frame, channel, stiff), value, torque_nm)| Setpoint {
        frame,
        channel,
        stiff,
        value,
        torque_nm,
    })
}

fn dishonest() -> impl Strategy<Value = Stimulus> {
    prop_oneof![
        4 => honest(),
        2 => feedback().prop_map(|(bus, frame)| Stimulus::Actuator(bus, frame)),
        1 => (0u8..3, frame()).prop_map(|(bus, frame)| Stimulus::Actuator(bus, frame)),
        1 => (-2_000_000i64..5_000_000).prop_map(Stimulus::TimeJump),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    /// Checks that the robot recovers after random sequences. Without a host, its torque goes off. With a host and working
    /// actuators, it returns to SAFE.
    #[test]
    fn the_way_home_is_never_lost(stimuli in prop::collection::vec(honest(), 1..60)) {
        let mut rig = Rig::new(Some(&library()));
        for stimulus in &stimuli {
            act(&mut rig, stimulus);
        }
        assert_way_home(&mut rig);
    }

    /// False feedback and a false clock cause no panic, and commands stay within the limits.
    #[test]
    fn lies_do_not_get_past_the_limits(stimuli in prop::collection::vec(dishonest(), 1..120)) {
        let mut rig = Rig::new(Some(&library()));
        rig.trust_pose = false;
        for stimulus in &stimuli {
            act(&mut rig, stimulus);
        }
        rig.estop();
        prop_assert_eq!(rig.brain.state(), State::EStopped);
    }
}

/// Random sequences reach every state. The generator has a fixed seed, hence the result is reproducible.
#[test]
fn the_sequences_reach_every_state() {
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;
    let mut runner = TestRunner::deterministic();
    let mut seen = std::collections::HashSet::new();
    for _ in 0..200 {
        let stimuli =
            prop::collection::vec(honest(), 1..60).new_tree(&mut runner).unwrap().current();
        let mut rig = Rig::new(Some(&library()));
        for stimulus in &stimuli {
            act(&mut rig, stimulus);
            seen.insert(rig.brain.state());
        }
    }
    use State::*;
    let expected = [Disarmed, Aligning, Ready, Playing, Returning, Damped, TorqueOff, EStopped];
    assert!(expected.iter().all(|state| seen.contains(state)), "only {seen:?}");
}

/// A lagging joint gets a smaller feed-forward torque. The full torque returns at once when the joint has caught up. In both
/// cases the sum of feedback and feed-forward torque is within the limit.
#[test]
fn a_torque_that_was_scaled_comes_back() {
    let mut rig = Rig::new(Some(&library()));
    let at = |value, torque_nm| Setpoint { frame: 0, channel: 1, stiff: false, value, torque_nm };
    rig.run(1);
    for stimulus in [Stimulus::Arm, Stimulus::Run(160), Stimulus::Command(Action::Stream)] {
        act(&mut rig, &stimulus);
    }
    assert_eq!(rig.brain.state(), State::Streaming);
    act(&mut rig, &Stimulus::Answers(1, at(-0.165_974_59, -18.017_752)));
    assert_way_home(&mut rig);
}
