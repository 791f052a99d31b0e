//! Fuzz target for a controller on the bench of the firmware's tests, with commands, garbage, losses, false data and time
//! jumps.
//!
//! The bench checks every frame. No set-point is sent without torque or beyond the limits. An emergency stop takes effect at
//! once, and the controller can recover from every state.

use arbitrary::{Result, Unstructured};
use rollwalk_protocol::actuator::{ActuatorStatus, Feedback};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::library::PlaceCode;
use rollwalk_protocol::wire::authentication::SessionRequest;
use rollwalk_protocol::wire::{Action, ParameterAction, Request, Setpoint, State, Torque};

use crate::authentication;
use crate::rig::Rig;
use crate::robot::{self, CODE_DRIVE, CODE_STAND, CODE_WALK};
use crate::stimuli::{Stimulus, act, assert_way_home};

/// Maximum number of stimuli of an input; each takes at most ten simulated seconds.
const DEEDS: usize = 80;

/// Identifiers that the controller evaluates.
const KNOWN: [u16; 10] = [0x010, 0x0F0, 0x110, 0x1F0, 0x210, 0x510, 0x610, 0x710, 0x7F0, 0x012];

/// Tags of stimuli, for seeds.
mod tag {
    pub const RUN: u8 = 0;
    pub const PLAY: u8 = 1;
    pub const ACTION: u8 = 2;
    pub const ARM: u8 = 3;
    pub const CLEAR: u8 = 4;
    pub const REPLAY: u8 = 5;
    pub const LINK: u8 = 6;
    pub const MESSAGE: u8 = 7;
    pub const BEGIN: u8 = 8;
    pub const FLASH: u8 = 9;
    pub const HOST: u8 = 10;
    pub const BUSES: u8 = 11;
    pub const POWER: u8 = 12;
    pub const STATUS: u8 = 13;
    pub const ESTOP: u8 = 14;
    pub const BOARD: u8 = 15;
    pub const PARAMETER: u8 = 16;
    pub const STREAM: u8 = 17;
    pub const SETPOINTS: u8 = 18;
    pub const TRACK: u8 = 19;
    pub const ANSWERS: u8 = 20;
    /// Smallest tag of a stimulus that sends false data.
    pub const FEEDBACK: u8 = 21;
    pub const FRAME: u8 = 22;
    pub const TIME: u8 = 23;
}

fn frame(u: &mut Unstructured<'_>) -> Result<Frame> {
    let chosen = u.arbitrary::<u8>()?;
    let id = match KNOWN.get(usize::from(chosen % 16)) {
        Some(&id) => id,
        None => u.arbitrary::<u16>()? & 0x7FF,
    };
    let len = usize::from(u.arbitrary::<u8>()? % 9).min(u.len());
    Ok(Frame::standard(id, u.bytes(len)?).expect("11 bits and 8 bytes"))
}

fn action(u: &mut Unstructured<'_>) -> Result<Action> {
    Ok(match u.arbitrary::<u8>()? % 8 {
        0 => Action::Pause,
        1 => Action::Return,
        2 => Action::Disarm,
        3 => Action::ArmRequest,
        4 => Action::ArmConfirm { nonce: u.arbitrary()? },
        5 => Action::ClearConfirm { nonce: u.arbitrary()? },
        6 => {
            let place = PlaceCode::from_code(u.arbitrary()?);
            Action::play(place, u.arbitrary()?, u.arbitrary()?)
        }
        _ => Action::Unknown { kind: u.int_in_range(11..=15)? },
    })
}

/// Parameter request with an allowed value, a forbidden value, or NaN.
fn parameter(u: &mut Unstructured<'_>) -> Result<ParameterAction> {
    Ok(match u.arbitrary::<u8>()? % 8 {
        0 => ParameterAction::Reset,
        1 => ParameterAction::Save,
        2 => ParameterAction::Origin,
        3 => ParameterAction::Unknown { kind: u.int_in_range(5..=15)? },
        4 => {
            ParameterAction::Get { parameter: u.arbitrary::<u8>()? & 0xF, channel: u.arbitrary()? }
        }
        how => {
            let (parameter, channel) = (u.arbitrary::<u8>()? % 4, u.arbitrary::<u8>()? % 4);
            let value = match how {
                5 => f32::from_bits(u.arbitrary()?),
                _ => f32::from(u.arbitrary::<u8>()?) / 6.0,
            };
            ParameterAction::Set { parameter, channel, value }
        }
    })
}

/// Set-point that decodes; in three of four cases it is near the SAFE pose.
fn setpoint(u: &mut Unstructured<'_>) -> Result<Setpoint> {
    let (how, channel) = (u.arbitrary::<u8>()?, u.arbitrary::<u8>()? % 4);
    let safe = robot::STAND.get(usize::from(channel)).copied().unwrap_or(0.0);
    let value = match how % 4 {
        0 => f32::from(u.arbitrary::<i16>()?) / 50.0,
        _ => safe + f32::from(u.arbitrary::<i8>()?) / 400.0,
    };
    let torque_nm = f32::from(u.arbitrary::<i16>()?) / 1000.0;
    let (frame, stiff) = (u.arbitrary()?, u.arbitrary()?);
    Ok(Setpoint { frame, channel, stiff, value, torque_nm })
}

/// Feedback of an actuator with any measurement and any status, in a frame that decodes.
fn feedback(u: &mut Unstructured<'_>) -> Result<Frame> {
    let feedback = Feedback {
        position_rad: f32::from(u.arbitrary::<i8>()?) / 20.0,
        velocity_rad_s: f32::from(u.arbitrary::<i8>()?) / 2.0,
        torque_nm: 0.0,
        status: ActuatorStatus(u.arbitrary()?),
        counter: u.arbitrary()?,
    };
    Ok(feedback.encode(u.int_in_range(1..=2)?).expect("an address"))
}

fn stimulus(u: &mut Unstructured<'_>, lies: bool) -> Result<Stimulus> {
    let count = if lies { tag::TIME } else { tag::ANSWERS } + 1;
    let servo = |u: &mut Unstructured<'_>| u.choose_index(robot::CHANNELS);
    Ok(match u.arbitrary::<u8>()? % count {
        tag::RUN => Stimulus::Run(u.arbitrary::<u8>()?.into()),
        tag::PLAY => {
            let code = *u.choose(&[CODE_STAND, CODE_DRIVE, CODE_WALK])?;
            Stimulus::Command(Action::Play { code, speed_64ths: 64 })
        }
        tag::ACTION => Stimulus::Command(action(u)?),
        tag::ARM => Stimulus::Arm,
        tag::CLEAR => Stimulus::Clear,
        // Numbers wrap at 16: a valid command from nine commands ago counts as new.
        tag::REPLAY => Stimulus::Replay(u.arbitrary::<u8>()? % 8),
        tag::LINK => Stimulus::Link(frame(u)?),
        tag::MESSAGE => {
            let len = usize::from(u.arbitrary::<u8>()? % 40 + 1).min(u.len());
            let bytes = u.bytes(len)?;
            // Messages are never empty.
            Stimulus::Transfer(if bytes.is_empty() { vec![1] } else { bytes.to_vec() })
        }
        tag::BEGIN => Stimulus::Begin(u.arbitrary()?),
        tag::FLASH => Stimulus::Flash,
        tag::HOST => Stimulus::Host(u.arbitrary()?),
        tag::BUSES => Stimulus::Buses(u.arbitrary()?),
        tag::POWER => Stimulus::Power(servo(u)?, u.arbitrary()?),
        tag::STATUS => Stimulus::Status(servo(u)?, u.arbitrary::<u8>()? & ActuatorStatus::FAULTS),
        tag::ESTOP => Stimulus::Estop,
        tag::BOARD => Stimulus::Board,
        tag::PARAMETER => Stimulus::Parameter(parameter(u)?),
        tag::STREAM => Stimulus::Command(Action::Stream),
        tag::SETPOINTS => Stimulus::Setpoints(u.arbitrary::<u8>()?, setpoint(u)?),
        tag::TRACK => {
            let rate_hz = 15 + u16::from(u.arbitrary::<u8>()? % 110);
            let (kp_percent, kd_percent) = (u.arbitrary::<u8>()? % 102, u.arbitrary::<u8>()? % 102);
            Stimulus::Command(Action::Track { rate_hz, kp_percent, kd_percent })
        }
        tag::ANSWERS => Stimulus::Answers(u.arbitrary()?, setpoint(u)?),
        tag::FEEDBACK => Stimulus::Actuator(u.int_in_range(0..=2)?, feedback(u)?),
        tag::FRAME => Stimulus::Actuator(u.int_in_range(0..=2)?, frame(u)?),
        _ => Stimulus::TimeJump(i64::from(u.arbitrary::<i16>()?) * 100),
    })
}

/// Runs a sequence of stimuli on a controller. With `insists` the controller requires a key. No stimulus has the key, so torque
/// must stay off.
fn after(u: &mut Unstructured<'_>, lies: bool, insists: bool) -> Result<Rig> {
    let mut rig = Rig::new(Some(&robot::library()));
    rig.trust_pose = !lies;
    if insists {
        rig.brain.require_key(authentication::key(), Some(1));
        // The self test loads the library.
        rig.run(20);
    }
    for _ in 0..DEEDS {
        if u.is_empty() {
            break;
        }
        act(&mut rig, &stimulus(u, lies)?);
        if insists {
            assert_eq!(rig.brain.state().torque(), Torque::Off);
            assert!(rig.brain.library().is_some());
        }
    }
    Ok(rig)
}

fn play(u: &mut Unstructured<'_>) -> Result<()> {
    let how = u.arbitrary::<u8>()?;
    let (lies, insists) = (how & 1 != 0, how & 8 != 0);
    let mut rig = after(u, lies, insists)?;
    // A controller that got forged feedback may refuse to continue. One in four of the others is checked to continue.
    if !lies && !insists && how & 6 == 0 {
        assert_way_home(&mut rig);
    }
    rig.estop();
    assert_eq!(rig.brain.state(), State::EStopped);
    Ok(())
}

/// Runs a sequence of stimuli. The first byte selects whether actuators and clock send false data, and whether the controller
/// requires a key.
pub fn run(data: &[u8]) {
    // An error means that a stimulus was cut off.
    let _ = play(&mut Unstructured::new(data));
}

/// Seeds with normal operation of a robot, and with operation in which something fails.
pub fn seeds() -> Vec<Vec<u8>> {
    use tag::*;
    let armed = [RUN, 30, ARM, RUN, 250, RUN, 250];
    let plays = [PLAY, 2, RUN, 200, PLAY, 1, RUN, 250, ACTION, 1, RUN, 250];
    let day = [&armed[..], &plays, &[ACTION, 2, RUN, 250]].concat();
    let stopped = [&armed[..], &plays[..4], &[ESTOP, RUN, 9, CLEAR, RUN, 20, ARM]].concat();
    let lost = [&armed[..], &plays[..4], &[HOST, 0, RUN, 250, RUN, 250, HOST, 1, CLEAR]].concat();
    let broken = [&armed[..], &plays[..4], &[POWER, 1, 0, RUN, 250, POWER, 1, 1, CLEAR]].concat();
    let hot =
        [&armed[..], &[STATUS, 0, 16, RUN, 99, STATUS, 0, 0, CLEAR, BUSES, 0, RUN, 9]].concat();
    let flashed = [&[RUN, 30, BEGIN, 9, 0, 0, 0, FLASH][..], &armed, &plays].concat();
    let mut out = [0; 32];
    let hello = Request::Hello { major: 1, minor: 0 }.encode(&mut out).expect("fits");
    let talk = [&[RUN, 30, MESSAGE, hello.len() as u8 - 1][..], hello, &[REPLAY, 0]].concat();
    let log = Request::Log { since: 0 }.encode(&mut out).expect("fits");
    let told = [&stopped[..], &[MESSAGE, log.len() as u8 - 1], log, &[RUN, 9]].concat();
    let set = [PARAMETER, 6, 0, 1, 200, PARAMETER, 6, 1, 2, 3, PARAMETER, 1, PARAMETER, 4, 0, 1];
    let tuned = [&armed[..], &set, &plays, &[PARAMETER, 0, RUN, 99]].concat();
    let streams = [STREAM, SETPOINTS, 40, 1, 0, 9, 0, 0, 0, RUN, 90];
    let streamed = [&armed[..], &streams, &[ACTION, 1, RUN, 250], &streams, &[RUN, 250]].concat();
    let link = [LINK, 4, 8, 0, 0, 0, 0, 0, 0, 0, 0, LINK, 1, 0, BOARD, CLEAR];
    let lies = [FEEDBACK, 0, 50, 9, 1, 1, 0, FRAME, 0, 9, 0, 8, 1, 2, 3, 4, 5, 6, 7, 8, TIME, 9, 9];
    let lying = [&armed[..], &lies, &plays].concat();
    // Seeds that reach nothing would not be noticed.
    let plays_in = after(&mut Unstructured::new(&[&armed[..], &plays[..4]].concat()), false, false);
    assert_eq!(plays_in.map(|rig| rig.brain.state()), Ok(State::Playing));
    let seed = |how: u8, stimuli: &[u8]| [&[how], stimuli].concat();
    let mut seeds: Vec<_> = [
        &day[..],
        &stopped,
        &lost,
        &broken,
        &hot,
        &flashed,
        &talk,
        &told,
        &tuned,
        &streamed,
        &link,
    ]
    .into_iter()
    .flat_map(|stimuli| [seed(0, stimuli), seed(2, stimuli), seed(1, stimuli)])
    .collect();
    seeds.push(seed(1, &lying));
    let request = SessionRequest { nonce: 7 }.encode();
    let proof = [LINK, 9, 8, 0x21, 1, 2, 3, 4, 5, 6, 7, LINK, 4, 8, 0, 0, 0, 0, 0, 0, 0, 0];
    let session =
        [&[RUN, 30, MESSAGE, request.len() as u8 - 1][..], &request, &proof, &armed].concat();
    seeds.extend([&session, &day, &flashed].map(|stimuli| seed(8, stimuli)));
    seeds
}
