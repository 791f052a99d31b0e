//! Gains and torque limits at run time: checked, smooth while driven, and kept over a power cycle.

use proptest::prelude::*;

use rollwalk_firmware::{Controller, Settings};
use rollwalk_protocol::actuator::KP_STEP_NM_RAD;
use rollwalk_protocol::wire::{
    Action, CommandResult, FromController, Parameter, ParameterAck, ParameterAction,
    ParameterOrigin, ParameterRequest, ParameterResult, State,
};

use crate::flash;
use crate::rig::{Rig, me};
use crate::robot::*;

const KP: u8 = Parameter::Kp as u8;
const MAX_TORQUE: u8 = Parameter::MaxTorque as u8;
const SAVE: ParameterAction = ParameterAction::Save;

fn set(parameter: u8, channel: u8, value: f32) -> ParameterAction {
    ParameterAction::Set { parameter, channel, value }
}

fn answer(ack: ParameterAck) -> (ParameterResult, f32) {
    (ack.result, ack.value)
}

fn kp(rig: &mut Rig) -> f32 {
    let ack = rig.parameter(ParameterAction::Get { parameter: KP, channel: 0 });
    assert_eq!((ack.result, ack.parameter, ack.channel), (ParameterResult::Ok, KP, Some(0)));
    ack.value
}

fn origin(rig: &mut Rig) -> ParameterOrigin {
    let ack = rig.parameter(ParameterAction::Origin);
    assert_eq!((ack.result, ack.channel), (ParameterResult::Ok, None));
    ParameterOrigin::from_code(ack.value as u8).unwrap()
}

fn disarm(rig: &mut Rig) {
    rig.command(Action::Disarm);
    rig.run_until(State::Disarmed, 2000);
}

/// Values of kp in the set-points of a joint since it was enabled.
fn sent_stiffness(rig: &Rig, joint: usize) -> Vec<f32> {
    rig.servos[joint].setpoints.iter().map(|&(_, kp)| kp).collect()
}

#[test]
fn gains_set_while_disarmed_hold_from_the_first_setpoint() {
    let mut rig = Rig::booted();
    assert_eq!(answer(rig.parameter(set(KP, 1, 12.5))), (ParameterResult::Ok, 12.5));
    rig.arm();
    rig.run_until(State::Ready, 1000);
    assert!(
        sent_stiffness(&rig, 1).len() > 10 && sent_stiffness(&rig, 1).iter().all(|&kp| kp == 12.5)
    );
    assert!(sent_stiffness(&rig, 0).iter().all(|&kp| kp == 20.0));
}

#[test]
fn a_gain_changed_while_driven_does_not_kick() {
    let mut rig = Rig::ready();
    rig.run(10);
    let from = sent_stiffness(&rig, 0).len();
    assert_eq!(answer(rig.parameter(set(KP, 0, 40.0))), (ParameterResult::Ok, 40.0));
    rig.run(120);
    let kps = &sent_stiffness(&rig, 0)[from..];
    // Half a second at 120 Hz, and half a step of rounding at either end.
    let most = 20.0 / 60.0 + 1.01 * KP_STEP_NM_RAD;
    assert!(kps[0] < 20.0 + most && kps.last() == Some(&40.0), "{kps:?}");
    assert!(kps.windows(2).all(|k| k[1] >= k[0] && k[1] - k[0] <= most), "{kps:?}");
}

#[test]
fn what_is_out_of_range_is_answered_with_the_limit_and_changes_nothing() {
    let mut rig = Rig::ready();
    for (request, limit) in [
        (set(KP, 0, 40.5), 40.0),
        (set(KP, 0, f32::NAN), 40.0),
        // While torque is on, no request makes a joint limp.
        (set(KP, 0, 0.0), 10.0),
        (set(MAX_TORQUE, 2, 3.5), 3.0),
        (set(MAX_TORQUE, 2, f32::INFINITY), 3.0),
    ] {
        assert_eq!(answer(rig.parameter(request)), (ParameterResult::OutOfRange, limit));
    }
    let result = |rig: &mut Rig, action| rig.parameter(action).result;
    assert_eq!(result(&mut rig, set(9, 0, 1.0)), ParameterResult::UnknownParameter);
    assert_eq!(result(&mut rig, set(KP, 3, 1.0)), ParameterResult::UnknownChannel);
    let unknown = ParameterAction::Unknown { kind: 7 };
    assert_eq!(result(&mut rig, unknown), ParameterResult::UnknownRequest);
    assert_eq!(kp(&mut rig), 20.0);
    rig.run(100);
    assert!(sent_stiffness(&rig, 0).iter().all(|&kp| kp == 20.0));
}

/// SAVE is refused unless the robot is disarmed: writing flash stops the control loop, which must watch the cause of a stop.
#[test]
fn nothing_is_saved_but_while_disarmed() {
    let wrong_state = (ParameterResult::WrongState, 0.0);
    let mut rig = Rig::ready();
    assert_eq!(answer(rig.parameter(SAVE)), wrong_state);
    rig.estop();
    assert_eq!(answer(rig.parameter(SAVE)), wrong_state);
    let mut rig = Rig::ready();
    rig.host_alive = false;
    rig.run_until(State::TorqueOff, 1000);
    assert_eq!(answer(rig.parameter(SAVE)), wrong_state);
    let mut rig = Rig::booted();
    assert_eq!(answer(rig.parameter(SAVE)).0, ParameterResult::Ok);
}

#[test]
fn a_repeated_request_is_executed_once_and_a_late_one_not_at_all() {
    let mut rig = Rig::booted();
    let first = ParameterRequest { seq: 1, action: set(KP, 0, 10.0) };
    let second = ParameterRequest { seq: 2, action: set(KP, 0, 15.0) };
    let ack = rig.parameter_again(first);
    assert_eq!(rig.parameter_again(first), ack);
    assert_eq!(rig.parameter_again(second).result, ParameterResult::Ok);
    // A bridge repeats the first request.
    assert_eq!(rig.parameter_again(first).result, ParameterResult::OutOfOrder);
    let other = ParameterRequest { seq: 2, ..first };
    assert_eq!(rig.parameter_again(other).result, ParameterResult::OutOfOrder);
    rig.parameter(ParameterAction::Origin);
    rig.parameter(ParameterAction::Origin);
    assert_eq!(kp(&mut rig), 15.0);
}

#[test]
fn whoever_was_about_to_arm_must_ask_again() {
    let mut rig = Rig::booted();
    for action in [set(KP, 0, 10.0), ParameterAction::Reset, SAVE] {
        let nonce = rig.command(Action::ArmRequest).value;
        rig.parameter(action);
        assert_eq!(rig.command(Action::ArmConfirm { nonce }).result, CommandResult::WrongNonce);
    }
}

#[test]
fn what_was_saved_survives_a_power_cycle_and_what_was_not_does_not() {
    let mut rig = Rig::booted();
    assert_eq!(origin(&mut rig), ParameterOrigin::Configuration);
    rig.parameter(set(KP, 0, 10.0));
    let mut rig = rig.power_cycled(config());
    assert_eq!((kp(&mut rig), origin(&mut rig)), (20.0, ParameterOrigin::Configuration));

    rig.parameter(set(KP, 0, 11.0));
    assert_eq!(answer(rig.parameter(SAVE)), (ParameterResult::Ok, 0.0));
    rig.parameter(set(KP, 0, 12.0));
    let mut rig = rig.power_cycled(config());
    assert_eq!((kp(&mut rig), origin(&mut rig)), (11.0, ParameterOrigin::Saved));
    rig.arm();
    rig.run_until(State::Ready, 1000);
    assert!(sent_stiffness(&rig, 0).iter().all(|&kp| kp == 11.0));

    // Flash is not written while the robot moves. The refused request may be repeated unchanged.
    let save = ParameterRequest { seq: rig.next_parameter_seq(), action: SAVE };
    assert_eq!(rig.parameter_again(save).result, ParameterResult::WrongState);
    disarm(&mut rig);
    assert_eq!(rig.parameter_again(save).result, ParameterResult::Ok);
    rig.parameter(ParameterAction::Reset);
    assert_eq!(kp(&mut rig), 20.0);
    assert_eq!(rig.parameter(SAVE).result, ParameterResult::Ok);
    let mut rig = rig.power_cycled(config());
    assert_eq!((kp(&mut rig), origin(&mut rig)), (20.0, ParameterOrigin::Saved));
}

#[test]
fn a_set_saved_for_another_configuration_is_not_applied_and_the_host_can_see_it() {
    let mut rig = Rig::booted();
    rig.parameter(set(KP, 0, 11.0));
    rig.parameter(SAVE);
    let mut stiffer = config();
    stiffer.channels[1].kp_nm_rad = 25.0;
    let mut rig = rig.power_cycled(stiffer);
    assert_eq!((kp(&mut rig), origin(&mut rig)), (20.0, ParameterOrigin::OtherConfiguration));
    // The robot for which the gains were saved still has them.
    let mut rig = rig.power_cycled(config());
    assert_eq!((kp(&mut rig), origin(&mut rig)), (11.0, ParameterOrigin::Saved));
    // The board's settings have become stricter.
    rig.parameter(set(KP, 0, 35.0));
    rig.parameter(SAVE);
    rig.settings.max_gain_ratio = 1.5;
    let mut rig = rig.power_cycled(config());
    assert_eq!((kp(&mut rig), origin(&mut rig)), (20.0, ParameterOrigin::OutOfRange));
}

#[test]
fn clearing_a_fault_does_not_forget_what_was_set() {
    let mut rig = Rig::booted();
    rig.parameter(set(KP, 0, 11.0));
    rig.estop();
    rig.run(10);
    rig.clear();
    rig.run_until(State::Disarmed, 100);
    assert_eq!(kp(&mut rig), 11.0);
}

#[test]
fn a_controller_without_memory_says_so() {
    let mut brain = Controller::new(config(), flash::store(None), Settings::default());
    brain.tick(0);
    assert_eq!(brain.state(), State::Disarmed);
    let mut ask = |seq, action| {
        brain.on_link_frame(0, &ParameterRequest { seq, action }.encode(me()));
        let mut frames = std::iter::from_fn(|| brain.poll_link(0));
        frames.find_map(|frame| match FromController::decode(&frame).unwrap().1 {
            FromController::ParameterAck(ack) => Some(ack.result),
            _ => None,
        })
    };
    assert_eq!(ask(0, set(KP, 0, 10.0)), Some(ParameterResult::Ok));
    assert_eq!(ask(1, SAVE), Some(ParameterResult::StoreFailed));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Random requests while the robot walks: the rig receives no set-point, gain, torque or torque limit out of its range, and
    /// the robot continues to walk.
    #[test]
    fn requests_while_walking_lead_to_nothing_out_of_limits(
        requests in prop::collection::vec(
            (0u8..4, 0u8..4, prop_oneof![any::<u32>().prop_map(f32::from_bits), 0.5f32..45.0], 1u32..40),
            1..40,
        ),
    ) {
        let mut rig = Rig::ready();
        rig.play(CODE_WALK);
        rig.run(200);
        for &(parameter, channel, value, ticks) in &requests {
            rig.parameter(set(parameter, channel, value));
            rig.run(ticks);
        }
        prop_assert_eq!(rig.brain.state(), State::Playing);
    }
}

/// A stop button pressed at power-on takes effect before the first tick.
#[test]
fn a_stop_before_the_first_tick_does_not_lose_what_was_saved() {
    let mut rig = Rig::booted();
    assert_eq!(answer(rig.parameter(set(KP, 0, 12.0))).0, ParameterResult::Ok);
    assert_eq!(answer(rig.parameter(SAVE)).0, ParameterResult::Ok);
    let mut rig = rig.power_cycled(config());
    rig.brain.estop(rig.now_us);
    rig.run(20);
    rig.clear();
    rig.run(20);
    assert_eq!((origin(&mut rig), kp(&mut rig)), (ParameterOrigin::Saved, 12.0));
}
