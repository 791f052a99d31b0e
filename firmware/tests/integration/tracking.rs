//! Control loop that a host closes over the link: measurements at a fixed rate, set-points that answer them, and the robot's
//! behaviour without answers.

use crate::rig::{Rig, me};
use crate::robot::*;
use rollwalk_firmware::Settings;
use rollwalk_firmware::track::MISSED;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::{
    Action, CommandResult, FromController, Node, Parameter, ParameterAction, ParameterResult,
    Sample, Setpoint, State,
};

const TRACK: Action = Action::Track { rate_hz: 120, kp_percent: 10, kd_percent: 20 };
/// Number of control periods without an effective answer after which the robot holds still.
const PATIENCE: u32 = MISSED as u32 + 2;

/// Robot that a host tracks.
fn tracked() -> Rig {
    let mut rig = Rig::ready();
    let ack = rig.command(TRACK);
    assert_eq!((ack.result, ack.value), (CommandResult::Ok, 120));
    assert_eq!(rig.brain.state(), State::Streaming);
    rig
}

fn sample(rig: &Rig) -> Sample {
    let of = |(_, message): &(u64, FromController)| match message {
        FromController::Sample(sample) => Some(*sample),
        _ => None,
    };
    rig.heard.iter().rev().find_map(of).expect("it sends samples")
}

/// Number of the sample whose answer was in force when the newest sample was taken.
fn answered(rig: &Rig) -> Option<u8> {
    sample(rig).answered.map(|of| of.number)
}

fn setpoint(number: u8, channel: usize, value: f32) -> Setpoint {
    Setpoint { frame: number, channel: channel as u8, stiff: false, value, torque_nm: 0.0 }
}

/// Answers a sample with the SAFE set-points, modified by `change`.
fn answer(rig: &mut Rig, number: u8, change: impl Fn(&mut Setpoint)) {
    for (channel, value) in STAND.into_iter().enumerate() {
        let mut setpoint = setpoint(number, channel, value);
        change(&mut setpoint);
        rig.send(&setpoint.encode(me()));
    }
}

/// Answers each sample for `periods` control periods.
fn follow(rig: &mut Rig, periods: u32, change: impl Fn(&mut Setpoint)) {
    for _ in 0..periods {
        rig.run(1);
        let number = sample(rig).number;
        answer(rig, number, &change);
    }
}

#[test]
fn measurements_come_at_the_rate_in_their_order() {
    for (rate_hz, periods) in [(120, 1), (100, 1), (60, 2), (50, 2), (40, 3)] {
        let mut rig = Rig::ready();
        let ack = rig.command(Action::Track { rate_hz, kp_percent: 0, kd_percent: 100 });
        assert_eq!((ack.result, ack.value), (CommandResult::Ok, 120 / periods as u16));
        rig.heard.clear();
        for count in 0..12 {
            rig.brain.on_imu([0.5, f32::from(count as u8), 0.0], [0.0, 0.0, 9.8]);
            rig.brain.on_contacts(0b11);
            // The number is kept constant, so the loop continues.
            rig.run(1);
            if let Some(number) = rig.heard.iter().rev().find_map(|(_, m)| match m {
                FromController::Sample(sample) => Some(sample.number),
                _ => None,
            }) {
                answer(&mut rig, number, |_| ());
            }
        }
        let mut order = String::new();
        let mut numbers = Vec::new();
        for (_, message) in &rig.heard {
            match message {
                FromController::Gyro(_) => order.push('g'),
                FromController::Accelerometer(of) => {
                    assert!((of.m_s2[2] - 9.8).abs() < 5e-3, "the mean of {periods}");
                    order.push('a');
                }
                FromController::JointTelemetry(joint) => {
                    order.push(char::from(b'0' + joint.channel));
                }
                FromController::Sample(sample) => {
                    order.push('s');
                    numbers.push(sample.number);
                    assert_eq!(sample.contacts, Some(0b11));
                }
                _ => {}
            }
        }
        assert_eq!(order, "ga012s".repeat(12 / periods));
        assert_eq!(numbers, (0..12 / periods as u8).collect::<Vec<_>>());
    }
}

#[test]
fn what_is_not_measured_is_left_out() {
    let mut rig = tracked();
    rig.heard.clear();
    rig.brain.on_imu([f32::NAN, 0.0, 0.0], [0.0; 3]);
    rig.run(1);
    let imu = |rig: &Rig| {
        let is = |message: &FromController| {
            matches!(message, FromController::Gyro(_) | FromController::Accelerometer(_))
        };
        rig.heard.iter().filter(|(_, message)| is(message)).count()
    };
    assert_eq!((imu(&rig), sample(&rig).contacts), (0, None));
    rig.brain.on_imu([0.1; 3], [0.0; 3]);
    rig.brain.on_contacts(0);
    rig.run(1);
    assert_eq!((imu(&rig), sample(&rig).contacts), (2, Some(0)));
    // The host does not send it again.
    rig.run(1);
    assert_eq!((imu(&rig), sample(&rig).contacts), (2, None));
}

#[test]
fn measurements_from_before_are_of_no_sample() {
    let mut rig = Rig::booted();
    for _ in 0..70_000 {
        rig.brain.on_imu([9.0; 3], [0.0, 0.0, 50.0]);
    }
    rig.brain.on_contacts(0b1);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    rig.command(TRACK);
    rig.heard.clear();
    rig.run(1);
    let imu = |(_, message): &&(u64, FromController)| {
        matches!(message, FromController::Gyro(_) | FromController::Accelerometer(_))
    };
    assert_eq!((rig.heard.iter().filter(imu).count(), sample(&rig).contacts), (0, None));
}

#[test]
fn a_host_whose_answers_are_old_does_not_steer() {
    let mut rig = tracked();
    follow(&mut rig, 4, |_| ());
    let kp = config().channels[0].kp_nm_rad;
    for _ in 0..20 {
        rig.run(1);
        // Each sample is answered, but much later.
        let number = sample(&rig).number.wrapping_sub(8);
        answer(&mut rig, number, |_| ());
    }
    assert_eq!(rig.brain.state(), State::Streaming);
    assert!((rig.servos[0].setpoints.last().unwrap().1 - kp).abs() < 0.01 * kp, "it holds still");
    assert!(rig.stands());
    for _ in 0..12 {
        rig.run(1);
        let number = sample(&rig).number.wrapping_sub(8);
        answer(&mut rig, number, |setpoint| setpoint.value += 0.1);
    }
    assert!(rig.brain.faults().contains(Fault::SetpointTimeout), "they are no answers");
    assert!(rig.stands());
}

/// Tests late answers, with which the robot holds still repeatedly. The gains must not rise each time that an answer takes
/// effect.
#[test]
fn gains_do_not_flicker_with_the_age_of_answers() {
    for age in 0..10 {
        let mut rig = tracked();
        follow(&mut rig, 8, |_| ());
        let kp = config().channels[0].kp_nm_rad;
        rig.servos[0].setpoints.clear();
        for _ in 0..40 {
            rig.run(1);
            let number = sample(&rig).number.wrapping_sub(age);
            answer(&mut rig, number, |_| ());
        }
        let gains: Vec<f32> = rig.servos[0].setpoints.iter().map(|(_, kp)| *kp).collect();
        let rises = gains.windows(2).filter(|two| two[1] > two[0] + 0.01 * kp).count();
        let falls = gains.windows(2).filter(|two| two[1] < two[0] - 0.01 * kp).count();
        assert_eq!(falls, 0, "{age}: {gains:?}");
        assert_eq!(rises > 0, age > 4, "{age}: {gains:?}");
    }
}

/// A joint under load has a set-point away from its position. Full gains at once would pull it there.
#[test]
fn a_joint_that_is_held_stays_where_it_is() {
    let ends: [fn(&mut Rig); 4] = [
        |rig| rig.run(20),
        // The loop continues, and ends again.
        |rig| {
            rig.run(20);
            follow(rig, 20, |_| ());
            rig.run(20);
        },
        |rig| assert_eq!(rig.command(Action::Return).result, CommandResult::Ok),
        |rig| assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok),
    ];
    for end in ends {
        let mut rig = tracked();
        let kp = config().channels[0].kp_nm_rad;
        // 0.01 rad with full gains.
        rig.servos[0].load_nm = 0.01 * kp;
        follow(&mut rig, 40, |_| ());
        let before = rig.servos[0].value;
        assert!((before - STAND[0]).abs() > 0.09, "{before}");
        end(&mut rig);
        let mut last = before;
        for tick in 0..15 {
            let moved = (rig.servos[0].value - last).abs();
            // RETURN leads the joint to SAFE at 0.7 rad/s or less.
            assert!(moved < 0.006, "{tick}: {last} to {}", rig.servos[0].value);
            last = rig.servos[0].value;
            if rig.brain.state() == State::Streaming || rig.brain.state() == State::Aligning {
                rig.run(1);
            }
        }
    }
}

#[test]
fn an_answer_acts_from_the_next_period_on_with_its_gains() {
    let mut rig = tracked();
    follow(&mut rig, 3, |_| ());
    let config = config();
    let kp = config.channels[0].kp_nm_rad;
    // Gains fall at once, and rise gradually.
    for (stiff, part, periods) in [(false, 0.1, 1), (true, 1.0, 14), (false, 0.1, 1)] {
        rig.run(1);
        let mut number = 0;
        for _ in 0..periods {
            number = sample(&rig).number;
            answer(&mut rig, number, |setpoint| {
                setpoint.stiff = stiff;
                setpoint.value += if setpoint.channel == 0 { 0.01 } else { 0.0 };
                setpoint.torque_nm = 0.2;
            });
            rig.run(1);
        }
        let servo = &rig.servos[0];
        let (value, gain) = *servo.setpoints.last().unwrap();
        assert!(
            (value - STAND[0] - 0.01).abs() < 1e-3 && (gain - part * kp).abs() < 0.01 * kp,
            "{gain}"
        );
        assert!((servo.torques.last().unwrap() - 0.2).abs() < 2e-3);
        assert_eq!(answered(&rig), Some(number));
    }
}

#[test]
fn a_sample_tells_how_late_answers_are() {
    // In control periods: the answer to the present sample, one period later, and two. Measurements are one period older.
    for (rate_hz, waits) in [(120, 0), (120, 1), (120, 2), (60, 0), (60, 1)] {
        let mut rig = Rig::ready();
        rig.command(Action::Track { rate_hz, kp_percent: 10, kd_percent: 20 });
        rig.run(1);
        let number = sample(&rig).number;
        rig.run(waits);
        answer(&mut rig, number, |_| ());
        rig.run(4);
        let of = sample(&rig).answered.unwrap();
        let expected_s = f32::from(waits as u8 + 2) / 120.0;
        assert!((of.delay_s - expected_s).abs() < 2e-4, "{rate_hz} {waits}: {of:?}");
        assert_eq!(of.number, number);
    }
}

#[test]
fn the_speed_of_a_joint_is_that_between_answers() {
    let mut rig = tracked();
    let mut value = STAND[0];
    for _ in 0..20 {
        value += 0.01;
        follow(&mut rig, 1, |setpoint| {
            if setpoint.channel == 0 {
                setpoint.value = value;
            }
        });
    }
    rig.run(1);
    let target = rig.brain.setpoint(0).unwrap();
    assert!((target.slope - 0.01 * 120.0).abs() < 0.02, "{target:?}");
}

#[test]
fn a_part_of_an_answer_and_what_is_late_do_nothing() {
    let mut rig = tracked();
    follow(&mut rig, 4, |_| ());
    rig.run(1);
    let number = sample(&rig).number;
    let moved = |setpoint: &mut Setpoint| setpoint.value += 0.1;
    // Set-points of two of three channels.
    for channel in 0..2 {
        rig.send(&setpoint(number, channel, STAND[channel] + 0.1).encode(me()));
    }
    // Answers to a future sample, to a sample before the one in force, and to all controllers.
    answer(&mut rig, number.wrapping_add(1), moved);
    answer(&mut rig, number.wrapping_sub(2), moved);
    rig.send(&setpoint(number, 2, 5.0).encode(Node::BROADCAST));
    rig.run(1);
    assert!(rig.stands());
    assert_eq!(answered(&rig), Some(number.wrapping_sub(1)));
    // The remaining channel.
    rig.send(&setpoint(number, 2, 0.0).encode(me()));
    rig.run(1);
    assert_eq!(answered(&rig), Some(number));
    assert!(!rig.stands());
}

#[test]
fn a_whole_answer_acts_although_the_next_one_has_begun() {
    let mut rig = tracked();
    follow(&mut rig, 4, |_| ());
    for _ in 0..20 {
        rig.run(1);
        let number = sample(&rig).number;
        // The answer to the previous sample is complete at last, and the answer to this sample begins.
        answer(&mut rig, number.wrapping_sub(1), |_| ());
        rig.send(&setpoint(number, 0, STAND[0]).encode(me()));
        // An older answer is too late.
        answer(&mut rig, number.wrapping_sub(2), |setpoint| setpoint.value += 0.2);
        rig.run(1);
        assert_eq!(answered(&rig), Some(number.wrapping_sub(1)));
        assert!(rig.stands());
        rig.send(&setpoint(number, 1, STAND[1]).encode(me()));
        rig.send(&setpoint(number, 2, 0.0).encode(me()));
    }
}

#[test]
fn it_begins_near_safe_only() {
    for off in [0.36, -0.36] {
        let mut rig = tracked();
        follow(&mut rig, 10, |setpoint| {
            if setpoint.channel == 1 {
                setpoint.value += off;
            }
        });
        assert!(rig.stands());
        assert_eq!(answered(&rig), None, "{off} rad from SAFE");
        follow(&mut rig, 2, |setpoint| setpoint.value += 0.01);
        assert!(answered(&rig).is_some());
    }
}

/// Limits of playback apply to tracking too.
#[test]
fn a_joint_that_does_not_follow_and_a_motor_without_torque_end_it() {
    type Cause = fn(&mut Rig);
    let causes: [(Cause, Fault); 2] = [
        (|rig| rig.servos[0].jammed_at = Some(-1.4), Fault::TrackingError),
        (|rig| rig.servos[1].enabled = false, Fault::ActuatorFault),
    ];
    for (cause, fault) in causes {
        let mut rig = tracked();
        follow(&mut rig, 30, |_| ());
        assert_eq!(rig.brain.state(), State::Streaming);
        cause(&mut rig);
        for _ in 0..240 {
            rig.run(1);
            if rig.brain.state() == State::Streaming {
                let number = sample(&rig).number;
                answer(&mut rig, number, |_| ());
            }
        }
        assert!(rig.brain.faults().contains(fault), "{fault:?}: {:?}", rig.brain.faults());
        assert!(!matches!(rig.brain.state(), State::Streaming | State::Ready), "{fault:?}");
    }
}

/// Answers to a sample that was not taken yet, or to one so old that the robot would hold still.
#[test]
fn answers_to_no_sample_of_late_are_none() {
    for off in [1, 2, 100, 250, 251] {
        let mut rig = tracked();
        rig.run(3);
        for _ in 0..6 {
            rig.run(1);
            let number = sample(&rig).number.wrapping_add(off);
            answer(&mut rig, number, |_| ());
        }
        assert_eq!(answered(&rig), None, "{off} ahead of the newest sample");
    }
}

/// A halted robot does not wait until the latest answer is too old.
#[test]
fn a_tracked_robot_that_is_disarmed_brakes_at_once() {
    let mut rig = tracked();
    let roll = |setpoint: &mut Setpoint| {
        if setpoint.channel == 2 {
            setpoint.value = 1.0;
        }
    };
    follow(&mut rig, 120, roll);
    let speed_rad_s = |rig: &Rig| rig.brain.setpoint(2).unwrap().value;
    assert_eq!(speed_rad_s(&rig), 1.0);
    rig.command(Action::Disarm);
    assert_eq!(rig.brain.state(), State::Returning);
    follow(&mut rig, 2, roll);
    assert!(speed_rad_s(&rig) < 1.0, "{}", speed_rad_s(&rig));
}

/// Numbers wrap, so that numbers before the first one would be those of recent samples.
#[test]
fn answers_to_samples_before_the_first_are_none() {
    for before in 1..5u8 {
        let mut rig = tracked();
        rig.run(1);
        assert_eq!(sample(&rig).number, 0);
        answer(&mut rig, 0u8.wrapping_sub(before), |_| ());
        rig.run(1);
        assert_eq!(answered(&rig), None, "{before} before the first sample");
        follow(&mut rig, 2, |_| ());
        assert!(answered(&rig).is_some());
    }
}

/// Feed-forward fraction applies to torques of libraries, not of the host. Along the ramp, the host's torques turn into those
/// of SAFE.
#[test]
fn the_torques_of_the_host_do_not_end_at_once_with_return() {
    let mut rig = Rig::ready();
    let (parameter, value) = (Parameter::FeedForward.code(), 0.0);
    let ack = rig.parameter(ParameterAction::Set { parameter, channel: 0, value });
    assert_eq!(ack.result, ParameterResult::Ok);
    rig.command(TRACK);
    follow(&mut rig, 20, |setpoint| setpoint.torque_nm = 1.0);
    rig.command(Action::Return);
    let nm = |rig: &Rig| *rig.servos[0].torques.last().unwrap();
    rig.run(5);
    assert!(nm(&rig) > 0.9, "{}", nm(&rig));
    rig.run_until(State::Ready, 1000);
    assert_eq!(nm(&rig), 0.0);
}

/// A stiff answer sets the targets of joints at once, also while gains still rise after a hold.
#[test]
fn a_stiff_answer_after_a_hold_is_where_it_says() {
    let mut rig = tracked();
    rig.servos[0].load_nm = 0.01 * config().channels[0].kp_nm_rad;
    follow(&mut rig, 40, |_| ());
    rig.run(PATIENCE + 3);
    follow(&mut rig, 3, |setpoint| setpoint.stiff = true);
    let value = rig.servos[0].setpoints.last().unwrap().0;
    assert!((value - STAND[0]).abs() < 1e-3, "{value}");
}

#[test]
fn without_answers_it_holds_still_with_all_gains_and_then_goes_home() {
    let mut rig = tracked();
    follow(&mut rig, 40, |setpoint| {
        setpoint.value = if setpoint.channel == 2 { 3.0 } else { setpoint.value + 0.1 };
        setpoint.torque_nm = 0.3;
    });
    let kp = config().channels[0].kp_nm_rad;
    // Answers are usually two samples late.
    rig.run(PATIENCE);
    let last = |rig: &Rig, channel: usize| *rig.servos[channel].setpoints.last().unwrap();
    assert!((last(&rig, 0).1 - 0.1 * kp).abs() < 0.01 * kp && (last(&rig, 2).0 - 3.0).abs() < 1e-3);
    rig.run(14);
    let (value, gain) = last(&rig, 0);
    assert!((value - STAND[0] - 0.1).abs() < 1e-3 && (gain - kp).abs() < 0.01 * kp);
    assert!((rig.servos[0].torques.last().unwrap() - 0.3).abs() < 2e-3, "it bears the robot");
    assert_eq!(last(&rig, 2).0, 0.0, "the wheel brakes");
    // The loop continues.
    follow(&mut rig, 2, |_| ());
    assert!((last(&rig, 0).1 - 0.1 * kp).abs() < 0.01 * kp);
    assert_eq!(rig.brain.state(), State::Streaming);
    // A quarter of a second is too long.
    rig.run(32);
    assert_eq!(rig.brain.state(), State::Returning);
    assert!(rig.brain.faults().contains(Fault::SetpointTimeout));
    follow(&mut rig, 3, |setpoint| setpoint.value += 0.1);
    assert!(rig.stands(), "answers are over");
    rig.run_until(State::TorqueOff, 600);
}

#[test]
fn return_leads_to_safe_and_motions_play_again() {
    let mut rig = tracked();
    follow(&mut rig, 40, |setpoint| setpoint.value += 0.2);
    assert!(!rig.stands());
    assert_eq!(rig.command(Action::Return).result, CommandResult::Ok);
    assert_eq!(rig.brain.state(), State::Aligning);
    rig.run_until(State::Ready, 1000);
    assert!(rig.stands());
    // Then a stream without samples works as before.
    assert_eq!(rig.command(Action::Stream).result, CommandResult::Ok);
    rig.heard.clear();
    rig.run(10);
    let samples = rig.heard.iter().filter(|(_, m)| matches!(m, FromController::Sample(_))).count();
    assert_eq!(samples, 0);
    rig.command(Action::Return);
    rig.run_until(State::Ready, 1000);
    assert_eq!(rig.play(CODE_WALK).result, CommandResult::Ok);
}

#[test]
fn a_link_that_cannot_carry_all_samples_carries_whole_ones() {
    // A controller that is polled less often than it has messages.
    let mut rig = tracked();
    rig.heard.clear();
    let mut numbers = Vec::new();
    for _ in 0..60 {
        rig.now_us += 8_333;
        rig.brain.tick(rig.now_us);
        for _ in 0..3 {
            if let Some(frame) = rig.brain.poll_link(rig.now_us)
                && let Ok((_, FromController::Sample(sample))) = FromController::decode(&frame)
            {
                numbers.push(sample.number);
            }
        }
    }
    assert!(numbers.len() > 5, "{numbers:?}");
    assert!(numbers.windows(2).all(|pair| pair[1].wrapping_sub(pair[0]) <= 3), "{numbers:?}");
}

#[test]
fn what_it_cannot_do_is_refused() {
    for (rate_hz, kp_percent, kd_percent) in
        [(0, 10, 20), (19, 10, 20), (121, 10, 20), (65_535, 10, 20), (120, 101, 20), (120, 10, 255)]
    {
        let mut rig = Rig::ready();
        let ack = rig.command(Action::Track { rate_hz, kp_percent, kd_percent });
        assert_eq!(ack.result, CommandResult::BadTracking);
        assert_eq!(rig.brain.state(), State::Ready);
        // The message does not wait for the next stream either.
        rig.command(Action::Stream);
        rig.heard.clear();
        rig.run(4);
        let samples = rig.heard.iter().filter(|(_, m)| matches!(m, FromController::Sample(_)));
        assert_eq!(samples.count(), 0);
    }
    let mut rig = Rig::booted();
    assert_eq!(rig.command(TRACK).result, CommandResult::NotArmed);
    let mut rig = tracked();
    assert_eq!(rig.command(TRACK).result, CommandResult::WrongState);
    // The lowest rate.
    let settings = Settings { control_hz: 960, ..Settings::default() };
    let mut rig = Rig::with(config(), settings, Some(&library()));
    rig.run(200);
    rig.arm();
    rig.run_until(State::Ready, 8000);
    let ack = rig.command(Action::Track { rate_hz: 20, kp_percent: 100, kd_percent: 100 });
    assert_eq!((ack.result, ack.value), (CommandResult::Ok, 20));
}
