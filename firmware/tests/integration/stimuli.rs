//! Actions and events on a controller in the test rig. Random tests and a fuzz target draw sequences from them.

use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::{
    Action, CommandResult, FromController, ParameterAction, ParameterResult, Request, Setpoint,
    State, Torque,
};

use crate::rig::{Rig, me};
use crate::robot::*;

/// Action or event on a controller.
#[derive(Clone, Debug)]
pub enum Stimulus {
    Run(u16),
    Command(Action),
    Parameter(ParameterAction),
    /// Arming in two steps, whatever the answers.
    Arm,
    Clear,
    Replay(u8),
    Link(Frame),
    Actuator(u8, Frame),
    Transfer(Vec<u8>),
    Begin(u32),
    Flash,
    Host(bool),
    Buses(bool),
    Power(usize, bool),
    Status(usize, u8),
    Estop,
    Board,
    TimeJump(i64),
    /// A set-point, followed by the given number of frames of all channels with the same values.
    Setpoints(u8, Setpoint),
    /// Answers to the given number of samples, each with the given set-point.
    Answers(u8, Setpoint),
}

pub fn act(rig: &mut Rig, stimulus: &Stimulus) {
    match stimulus {
        Stimulus::Run(ticks) => rig.run(u32::from(*ticks)),
        Stimulus::Command(action) => {
            rig.command(*action);
        }
        Stimulus::Parameter(action) => {
            rig.parameter(*action);
        }
        Stimulus::Arm => {
            let request = rig.command(Action::ArmRequest);
            rig.command(Action::ArmConfirm { nonce: request.value });
        }
        Stimulus::Clear => {
            let request = rig.command(Action::ClearRequest);
            rig.command(Action::ClearConfirm { nonce: request.value });
        }
        Stimulus::Replay(back) => rig.replay(usize::from(*back)),
        Stimulus::Link(frame) => rig.send(frame),
        Stimulus::Actuator(bus, frame) => rig.brain.on_actuator_frame(rig.now_us, *bus, frame),
        Stimulus::Transfer(bytes) => rig.send_message(bytes),
        Stimulus::Begin(len) => {
            rig.try_request(&Request::Begin { len: *len, digest: 5 });
        }
        Stimulus::Flash => {
            let bytes = library();
            let digest = rollwalk_protocol::crc::file_digest(&bytes);
            rig.try_request(&Request::Begin { len: bytes.len() as u32, digest });
            for (i, block) in bytes.chunks(512).enumerate() {
                rig.try_request(&Request::Block { offset: 512 * i as u32, bytes: block });
            }
            rig.try_request(&Request::Finish);
            rig.try_request(&Request::Activate { digest });
        }
        Stimulus::Host(alive) => rig.host_alive = *alive,
        Stimulus::Buses(up) => rig.buses_up = *up,
        Stimulus::Power(i, on) => {
            rig.servos[*i].powered = *on;
            rig.servos[*i].enabled &= *on;
        }
        Stimulus::Status(i, status) => rig.servos[*i].status = *status,
        Stimulus::Estop => {
            rig.estop();
            assert_eq!(rig.brain.state(), State::EStopped);
        }
        Stimulus::Board => {
            rig.brain.estop(rig.now_us);
            assert_eq!(rig.brain.state(), State::EStopped);
        }
        Stimulus::Setpoints(frames, first) => {
            rig.send(&first.encode(me()));
            for ahead in 1..=*frames {
                for (channel, value) in (0..).zip(STAND) {
                    let frame = first.frame.wrapping_add(ahead);
                    let value = if channel == first.channel { first.value } else { value };
                    rig.send(&Setpoint { frame, channel, value, ..*first }.encode(me()));
                }
                rig.run(2);
            }
        }
        Stimulus::Answers(samples, with) => {
            for _ in 0..*samples {
                rig.run(1);
                let number = rig.heard.iter().rev().find_map(|(_, message)| match message {
                    FromController::Sample(sample) => Some(sample.number),
                    _ => None,
                });
                // Without samples, the host answers samples that never existed.
                let frame = number.unwrap_or(with.frame);
                for (channel, value) in (0..).zip(STAND) {
                    let value = if channel == with.channel { with.value } else { value };
                    rig.send(&Setpoint { frame, channel, value, ..*with }.encode(me()));
                }
            }
        }
        Stimulus::TimeJump(us) => rig.now_us = rig.now_us.saturating_add_signed(*us),
    }
}

/// Checks that the robot recovers after any sequence. Without a host, its torque goes off. With a host and working actuators,
/// it returns to SAFE and plays.
pub fn assert_way_home(rig: &mut Rig) {
    rig.host_alive = false;
    // Timeout, longest route through the graph, hold and damping.
    rig.run(40 + 700 + 130 + 200);
    assert_eq!(rig.brain.state().torque(), Torque::Off);

    rig.host_alive = true;
    rig.buses_up = true;
    for servo in &mut rig.servos {
        (servo.powered, servo.status) = (true, 0);
    }
    rig.run(60);
    if rig.brain.state() != State::Disarmed {
        rig.clear();
        rig.run(60);
    }
    if rig.brain.library().is_none() {
        act(rig, &Stimulus::Flash);
    }
    // A joint without gain does not move.
    assert_eq!(rig.parameter(ParameterAction::Reset).result, ParameterResult::Ok);
    rig.arm();
    rig.run_until(State::Ready, 1500);
    assert_eq!(rig.play(CODE_WALK).result, CommandResult::Ok);
    rig.run(300);
    rig.command(Action::Return);
    rig.run_until(State::Ready, 1000);
}
