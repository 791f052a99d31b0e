//! Slow playback, pause and resume: playback time is scaled, and limits hold throughout.

use crate::rig::Rig;
use crate::robot::*;
use proptest::prelude::*;
use rollwalk_firmware::player::{PLANNED_SPEED_64THS, Player};
use rollwalk_protocol::config::ChannelKind;
use rollwalk_protocol::faults::Severity;
use rollwalk_protocol::library::{Library, validate};
use rollwalk_protocol::wire::{Action, CommandResult, State};

/// Robot in the middle of the gait.
fn walking() -> Rig {
    let mut rig = Rig::ready();
    let ack = rig.play(CODE_WALK);
    rig.run(2 * u32::from(ack.value) + 30);
    assert_eq!(rig.clip(), WALK_CLIP);
    rig
}

fn pause(rig: &mut Rig) {
    assert_eq!(rig.command(Action::Pause).result, CommandResult::Ok);
    assert_eq!(rig.brain.state(), State::Paused);
    // A halt from the planned speed takes 0.4 to 2 s.
    rig.run(240);
}

fn setpoints(rig: &Rig) -> [f32; CHANNELS] {
    std::array::from_fn(|c| rig.brain.setpoint(c).expect("torque is on").value)
}

#[test]
fn a_paused_robot_holds_still_and_goes_on_where_it_was() {
    let mut rig = walking();
    pause(&mut rig);
    let (held, at) = (setpoints(&rig), rig.brain.playing());
    assert_eq!(held[2], 0.0, "wheels stand");
    assert!((0..2).all(|c| rig.brain.setpoint(c).unwrap().slope == 0.0));
    rig.run(1000);
    assert_eq!((setpoints(&rig), rig.brain.playing()), (held, at));
    assert_eq!(rig.brain.state(), State::Paused);
    assert_eq!(rig.statuses().last().unwrap().1.severity, Severity::None);

    // A second PAUSE changes nothing.
    assert_eq!(rig.command(Action::Pause).result, CommandResult::Ok);
    assert_eq!(rig.command(Action::Resume).result, CommandResult::Ok);
    assert_eq!(rig.brain.state(), State::Playing);
    rig.run(240);
    assert_eq!(rig.clip(), WALK_CLIP);
    assert!(setpoints(&rig)[2] > 0.9, "it rolls again");
    assert_eq!(rig.command(Action::Resume).result, CommandResult::Ok);
}

#[test]
fn a_paused_robot_takes_return_and_no_other_motion() {
    let mut rig = walking();
    pause(&mut rig);
    assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::WrongState);
    assert_eq!(rig.command(Action::Return).result, CommandResult::Ok);
    assert_eq!(rig.brain.state(), State::Playing);
    rig.run_until(State::Ready, 1000);
    assert!(rig.stands());
}

#[test]
fn pause_and_resume_are_for_motions_only() {
    let mut rig = Rig::booted();
    for action in [Action::Pause, Action::Resume] {
        assert_eq!(rig.command(action).result, CommandResult::NotArmed);
    }
    rig.arm();
    for action in [Action::Pause, Action::Resume] {
        assert_eq!(rig.command(action).result, CommandResult::WrongState);
    }
    rig.run_until(State::Ready, 1000);
    for action in [Action::Pause, Action::Resume] {
        assert_eq!(rig.command(action).result, CommandResult::WrongState);
    }
}

#[test]
fn a_paused_robot_goes_home_when_the_host_is_lost_or_it_is_disarmed() {
    let mut rig = walking();
    pause(&mut rig);
    rig.host_alive = false;
    rig.run_until(State::Returning, 60);
    rig.run_until(State::Damped, 1000);
    assert!(rig.stands(), "from a halt too");
    rig.run_until(State::TorqueOff, 300);

    let mut rig = walking();
    pause(&mut rig);
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
    assert_eq!(rig.brain.state(), State::Returning);
    rig.run_until(State::Disarmed, 1000);
    assert!(rig.brain.faults().is_empty());
}

/// Returning at 1/64 of the speed would take minutes.
#[test]
fn nobody_watches_a_slow_robot_whose_host_is_lost() {
    let mut rig = Rig::ready();
    let slow = Action::Play { code: CODE_WALK, speed_64ths: 1 };
    assert_eq!(rig.command(slow).result, CommandResult::Ok);
    rig.run(600);
    rig.host_alive = false;
    rig.run_until(State::Returning, 60);
    // Transition, gait and transition of 91 frames with two ticks each, 0.4 s of acceleration, and a hold of one second.
    let ticks = rig.run_until(State::Damped, 1000);
    assert!(ticks < 2 * 91 + 60 + 130, "{ticks}");

    // The host is lost during a slow return.
    let mut rig = Rig::ready();
    assert_eq!(rig.command(slow).result, CommandResult::Ok);
    rig.run(600);
    rig.command(Action::Disarm);
    rig.run(60);
    rig.host_alive = false;
    assert!(rig.run_until(State::Damped, 1000) < 2 * 91 + 60 + 130 + 31);

    // An operator who disarms watches the robot, and chose the low speed.
    let mut rig = Rig::ready();
    let slow = Action::Play { code: CODE_WALK, speed_64ths: 16 };
    assert_eq!(rig.command(slow).result, CommandResult::Ok);
    rig.run(600);
    rig.command(Action::Disarm);
    let ticks = rig.run_until(State::Damped, 2000);
    assert!(ticks > 2 * 91, "{ticks}");
}

#[test]
fn the_watchdogs_watch_a_paused_robot() {
    let mut rig = walking();
    pause(&mut rig);
    rig.servos[0].powered = false;
    rig.run_until(State::Damped, 60);

    let mut rig = walking();
    pause(&mut rig);
    rig.estop();
    assert_eq!(rig.brain.state(), State::EStopped);
}

/// Playback at half the speed takes twice the time for the same trajectory.
#[test]
fn slow_playback_goes_the_same_way() {
    let ticks_of = |speed_64ths: i8| {
        let mut rig = Rig::ready();
        let play = Action::Play { code: CODE_DRIVE, speed_64ths };
        assert_eq!(rig.command(play).result, CommandResult::Ok);
        let mut highest = f32::MIN;
        let mut fastest = f32::MIN;
        let ticks = (0..4000)
            .take_while(|_| {
                rig.step();
                highest = highest.max(rig.servos[0].value);
                fastest = fastest.max(rig.servos[2].value);
                rig.brain.state() != State::Ready
            })
            .count();
        (ticks as f32, highest, fastest)
    };
    let (planned, high, fast) = ticks_of(64);
    let (half, same_high, half_fast) = ticks_of(32);
    // During the deceleration of 0.2 s, playback is faster than the final speed.
    assert!((half - 2.0 * planned).abs() < 40.0, "{planned} {half}");
    assert!((high - same_high).abs() < 2e-3, "{high} {same_high}");
    assert!((half_fast - 0.5 * fast).abs() < 2e-2, "{fast} {half_fast}");
}

#[test]
fn faster_than_planned_backwards_or_not_at_all_is_refused() {
    let mut rig = Rig::ready();
    for speed_64ths in [65, 127, 0, -1, -64, -128] {
        let play = Action::Play { code: CODE_WALK, speed_64ths };
        assert_eq!(rig.command(play).result, CommandResult::BadSpeed, "{speed_64ths}");
    }
    assert_eq!(rig.brain.state(), State::Ready);
}

/// Operator's command that changes playback time.
#[derive(Clone, Copy, Debug)]
enum Time {
    Speed(u8),
    Halt,
    GoOn,
}

fn times() -> impl Strategy<Value = Time> {
    prop_oneof![(1..=PLANNED_SPEED_64THS).prop_map(Time::Speed), Just(Time::Halt), Just(Time::GoOn)]
}

/// A frame rarely takes a whole number of control periods: the remainder of a period counts towards the next frame.
#[test]
fn playback_time_is_exact_at_every_speed() {
    let (config, bytes) = (config(), library());
    let index = validate(&bytes, &config).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    for speed_64ths in 1..=PLANNED_SPEED_64THS {
        let mut player = Player::start(&library, 2).unwrap();
        player.set_goal(&library, library.node_for_code(CODE_WALK).unwrap()).unwrap();
        player.set_speed(speed_64ths);
        let mut advance = || {
            player.advance(&library, &config).unwrap();
            player.playing()
        };
        // At the planned speed or slower into the gait, until the speed is constant.
        let begins = (0..4000).find(|_| advance().clip.0 == WALK_CLIP);
        assert!(begins.is_some(), "{speed_64ths}");
        let mut last = (0..240).map(|_| advance()).last().unwrap();
        for _ in 0..256 {
            let now = advance();
            assert_eq!(now.clip.0, WALK_CLIP);
            // Exact in f32: frames are below 64, and phases are fractions of a power of two.
            let frames = f32::from((now.frame + WALK_FRAMES - last.frame) % WALK_FRAMES);
            let advanced = frames + (now.phase - last.phase);
            assert_eq!(advanced, f32::from(speed_64ths) / 128.0, "{last:?} {now:?}");
            last = now;
        }
    }
}

proptest! {
    /// Joint speeds and wheel accelerations stay within their limits at any playback speed, even without the limiter.
    #[test]
    fn scaled_playback_keeps_the_limits(
        changes in prop::collection::vec((times(), 1u32..120), 1..40),
        code in prop_oneof![Just(CODE_DRIVE), Just(CODE_WALK)],
    ) {
        let (config, bytes) = (config(), library());
        let index = validate(&bytes, &config).unwrap();
        let library = Library::open(&bytes, &index).unwrap();
        let mut player = Player::start(&library, 2).unwrap();
        player.set_goal(&library, library.node_for_code(code).unwrap()).unwrap();
        let mut last: [f32; CHANNELS] = STAND;
        for (time, ticks) in changes {
            match time {
                Time::Speed(speed) => player.set_speed(speed),
                Time::Halt => player.halt(),
                Time::GoOn => player.go_on(),
            }
            for _ in 0..ticks {
                player.advance(&library, &config).unwrap();
                for (c, channel) in config.channels.iter().enumerate() {
                    let target = player.target(&config, c).unwrap();
                    let rate = (target.value - last[c]) * 120.0;
                    // Speed and curve change within the tick; a quantum of a wheel is 2^-10 rad/s.
                    let rounding = if channel.kind == ChannelKind::WheelSpeed { 1.5 } else { 0.1 };
                    prop_assert!(rate.abs() <= channel.max_rate + rounding, "{c}: {rate}");
                    prop_assert!(target.slope.abs() <= channel.max_rate + 0.1);
                    last[c] = target.value;
                }
            }
        }
    }
}
