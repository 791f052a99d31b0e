//! Frames of MIT's mini cheetah drive, which T-Motor's AK series uses in its MIT mode.
//!
//! Documents: bgkatz/motorcontrol (`CAN_com`), CubeMars "AK Series Actuator Driver Manual V1.0.8", section 5.3. A set-point has
//! 64 bits, most significant first: position 16, speed 12, kp 12, kd 12, torque 12. An answer consists of the drive's number 8,
//! position 16, speed 12, torque 12, and from AK drives temperature 8, error 8. A command consists of seven bytes `FF` and a
//! command byte.
//!
//! Ranges depend on the model: with the ranges of another model, the torque is wrong. Zero speed and zero torque lie between
//! two codes. The torque of a wheel compensates the rounding of its speed; see [`Mit::wheel`].

use core::fmt::Arguments;
use core::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::fixed::{Signed, Unsigned};
use super::named::{self, Named};
use super::settings::{Keys, Report, check_integer, or};
use super::{
    ActuatorCommand, Answers, CanCodec, Capabilities, Codec, Command, Faults, Feedback, Gains,
    JointSetpoint, Refusal, Traffic, UpdatePolicy, Watchdog, WheelSetpoint, without,
};
use crate::can::{Frame, worst_case_bits};

/// Ranges of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// Name of the model.
    pub name: &'static str,
    /// Largest speed, rad/s.
    pub max_speed_rad_s: f32,
    /// Largest torque, N·m.
    pub max_torque_nm: f32,
}

impl Named for Model {
    const ALL: &'static [Self] = &MODELS;

    fn name(&self) -> &'static str {
        self.name
    }
}

/// Largest position of every model, rad.
pub const MAX_POSITION_RAD: f32 = 12.5;
/// Largest kp of every model, N·m/rad.
pub const MAX_KP_NM_RAD: f32 = 500.0;
/// Largest kd of every model, N·m·s/rad.
pub const MAX_KD_NM_S_RAD: f32 = 5.0;

/// Range of the identifiers of answers of mini cheetah drives.
const MASTER_IDS: RangeInclusive<u32> = 0..=0x7FF;

const fn model(name: &'static str, max_speed_rad_s: f32, max_torque_nm: f32) -> Model {
    Model { name, max_speed_rad_s, max_torque_nm }
}

/// Supported models. AK drives have the ranges of section 5.3 of the manual. The mini cheetah has those of its published
/// firmware. Its torque range depends on the build of the drive, so compare it with yours.
pub const MODELS: [Model; 7] = [
    model("AK10-9", 50.0, 65.0),
    model("AK60-6", 50.0, 15.0),
    model("AK70-10", 50.0, 25.0),
    model("AK80-6", 76.0, 12.0),
    model("AK80-9", 50.0, 18.0),
    model("AK80-64", 8.0, 144.0),
    model("mini-cheetah", 65.0, 18.0),
];

/// Identifier of the answers of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AnswerId {
    /// Common identifier of all answers: the mini cheetah's `CAN_MASTER`.
    Master(u16),
    /// Identifier of the answering drive.
    Own,
}

/// Drives of one model on a bus.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mit {
    /// Model of the drives.
    #[serde(with = "named")]
    pub model: Model,
    /// Identifier of the drives' answers.
    pub answers_from: AnswerId,
}

/// Last byte of the command that switches torque on. Seven bytes `FF` precede it.
const ENTER: u8 = 0xFC;
/// Last byte of the command that switches torque off.
const EXIT: u8 = 0xFD;
/// Last byte of the command that makes the present position 0.
const ZERO: u8 = 0xFE;

const POSITION: Signed = Signed { max: MAX_POSITION_RAD, bits: 16 };
const KP: Unsigned = Unsigned { max: MAX_KP_NM_RAD, bits: 12 };
const KD: Unsigned = Unsigned { max: MAX_KD_NM_S_RAD, bits: 12 };

fn special(id: u8, last: u8) -> Frame {
    Frame::known(u16::from(id), [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last])
}

/// Codes of a set-point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Codes {
    /// Code of the position, 16 bits.
    pub position: u16,
    /// Code of the speed, 12 bits.
    pub speed: u16,
    /// Code of kp, 12 bits.
    pub kp: u16,
    /// Code of kd, 12 bits.
    pub kd: u16,
    /// Code of the torque, 12 bits.
    pub torque: u16,
}

impl Codes {
    /// Encodes the frame. A set-point with all values at their maximum would have the bytes of a command, and is sent with a
    /// little less torque.
    pub fn frame(self, id: u8) -> Frame {
        let Codes { position, speed, kp, kd, torque } = self;
        let [p1, p0] = position.to_be_bytes();
        let low4 = |x: u16| (x & 0xF) as u8;
        let high4 = |x: u16| ((x >> 8) & 0xF) as u8;
        let torque_low = torque as u8;
        let head = [
            p1,
            p0,
            (speed >> 4) as u8,
            low4(speed) << 4 | high4(kp),
            kp as u8,
            (kd >> 4) as u8,
            low4(kd) << 4 | high4(torque),
        ];
        let command = head == [0xFF; 7] && (ENTER..=ZERO).contains(&torque_low);
        let last = if command { ENTER - 1 } else { torque_low };
        let [b0, b1, b2, b3, b4, b5, b6] = head;
        Frame::known(u16::from(id), [b0, b1, b2, b3, b4, b5, b6, last])
    }

    /// Codes of a set-point, as a drive would decode them; `None` for commands and other frames.
    pub fn of(frame: &Frame) -> Option<Codes> {
        frame.standard_id()?;
        let data: [u8; 8] = frame.data().try_into().ok()?;
        let bits = u64::from_be_bytes(data);
        if matches!(data, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, ENTER..=ZERO]) {
            return None;
        }
        let field = |shift: u32, width: u32| (bits >> shift & ((1 << width) - 1)) as u16;
        Some(Codes {
            position: field(48, 16),
            speed: field(36, 12),
            kp: field(24, 12),
            kd: field(12, 12),
            torque: field(0, 12),
        })
    }
}

impl Mit {
    fn speed(&self) -> Signed {
        Signed { max: self.model.max_speed_rad_s, bits: 12 }
    }

    fn torque(&self) -> Signed {
        Signed { max: self.model.max_torque_nm, bits: 12 }
    }

    /// Codes of a joint's set-point.
    pub fn joint(&self, setpoint: &JointSetpoint) -> Result<Codes, Refusal> {
        let gains = setpoint.gains.ok_or(Refusal::Missing("gains"))?;
        let beyond = Refusal::OutOfRange;
        Ok(Codes {
            position: POSITION.encode(setpoint.position_rad).ok_or(beyond("position"))?,
            speed: self.speed().encode(setpoint.speed_rad_s).ok_or(beyond("speed"))?,
            kp: KP.encode(gains.kp_nm_rad).ok_or(beyond("kp"))?,
            kd: KD.encode(gains.kd_nm_s_rad).ok_or(beyond("kd"))?,
            torque: self.torque().encode(setpoint.torque_nm).ok_or(beyond("torque"))?,
        })
    }

    /// Codes of a wheel's set-point, with kp 0. The torque compensates the rounding of ω*, so that kd (ω* − ω) + τ is accurate
    /// to half a step of torque. At 0 rad/s a wheel creeps at up to half a step of torque divided by kd.
    pub fn wheel(&self, setpoint: &WheelSetpoint) -> Result<Codes, Refusal> {
        without(setpoint.torque_limit_nm, "torque limit")?;
        let kd = setpoint.kd_nm_s_rad.ok_or(Refusal::Missing("kd"))?;
        let gains = Some(Gains { kp_nm_rad: 0.0, kd_nm_s_rad: kd });
        let (speed_rad_s, torque_nm) = (setpoint.speed_rad_s, setpoint.torque_nm);
        let codes =
            self.joint(&JointSetpoint { position_rad: 0.0, speed_rad_s, torque_nm, gains })?;
        let rounding_nm = KD.decode(codes.kd) * (speed_rad_s - self.speed().decode(codes.speed));
        let most = self.model.max_torque_nm;
        // `clamp` would panic for a model whose range is NaN.
        let torque = self.torque().encode((torque_nm + rounding_nm).max(-most).min(most));
        Ok(Codes { torque: torque.ok_or(Refusal::OutOfRange("torque"))?, ..codes })
    }

    /// Codes of a set-point with zero torque, to within half a step of its scale.
    fn limp(&self, position_rad: f32) -> Result<Codes, Refusal> {
        let gains = Some(Gains { kp_nm_rad: 0.0, kd_nm_s_rad: 0.0 });
        self.joint(&JointSetpoint { position_rad, speed_rad_s: 0.0, torque_nm: 0.0, gains })
    }

    /// Makes the present position 0. Do not send it while torque is on: the drive keeps its set-point, and the joint moves
    /// there.
    pub fn zero_here(id: u8) -> Frame {
        special(id, ZERO)
    }
}

/// Translates an error code of an AK drive, as listed in the manual. Unlisted codes are [`Faults::OTHER`].
fn faults_of(error: u8) -> Faults {
    match error {
        0 => Faults::NONE,
        1 => Faults::OVERHEATED,
        2 => Faults::OVERCURRENT,
        3 | 4 => Faults::BAD_VOLTAGE,
        5 => Faults::SENSOR,
        _ => Faults::OTHER,
    }
}

impl Codec for Mit {
    type Sent = Frame;

    const EXAMPLES: &'static [Self] = &[
        Self { model: MODELS[6], answers_from: AnswerId::Master(0) },
        Self { model: MODELS[4], answers_from: AnswerId::Own },
    ];

    fn name(&self) -> &'static str {
        self.model.name
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            joints: true,
            wheels: true,
            gains: UpdatePolicy::EverySetpoint,
            max_gains: Gains { kp_nm_rad: KP.max, kd_nm_s_rad: KD.max },
            limits: UpdatePolicy::Never,
            joint_speed: true,
            torque: true,
            torque_alone: true,
            exact_zero_speed: false,
            answers: Answers::Always,
            measures_position: true,
            measures_torque: true,
            query: false,
            query_readings: false,
            reports_enabled: false,
            // Exit is answered even if it changes nothing.
            pose_while_disabled: true,
            watchdog: Watchdog::Resumes,
            max_id: 0x7F,
        }
    }

    /// Encodes an order. Enabling sends a limp set-point before and after, since a drive would follow the set-point that it
    /// received before.
    fn emit(&self, order: &ActuatorCommand, send: &mut dyn FnMut(Frame)) -> Result<(), Refusal> {
        let id = order.id;
        super::address(id, 0x7F)?;
        let enable = |position_rad: f32| Ok(self.limp(position_rad)?.frame(id));
        let limp = match order.command {
            Command::Disable => {
                send(special(id, EXIT));
                return Ok(());
            }
            // Every frame is answered, but every frame changes something, so none is a query.
            Command::Query | Command::QueryReadings => return Err(Refusal::Unsupported("query")),
            Command::ClearFaults => return Err(Refusal::Unsupported("clear faults")),
            Command::Gains(_) => return Err(Refusal::Unsupported("gains outside setpoints")),
            Command::Limits { .. } => return Err(Refusal::Unsupported("limits")),
            Command::Joint(setpoint) => {
                send(self.joint(&setpoint)?.frame(id));
                return Ok(());
            }
            Command::Wheel(setpoint) => {
                send(self.wheel(&setpoint)?.frame(id));
                return Ok(());
            }
            Command::EnableJoint { measured_rad } => enable(measured_rad)?,
            Command::EnableWheel | Command::EnableTorque => enable(0.0)?,
            Command::Torque { torque_nm } => {
                let gains = Some(Gains { kp_nm_rad: 0.0, kd_nm_s_rad: 0.0 });
                let (position_rad, speed_rad_s) = (0.0, 0.0);
                let alone = JointSetpoint { position_rad, speed_rad_s, torque_nm, gains };
                send(self.joint(&alone)?.frame(id));
                return Ok(());
            }
        };
        send(limp);
        send(special(id, ENTER));
        send(limp);
        Ok(())
    }

    fn traffic(&self, actuators: u32) -> Traffic {
        let bits_per_period = actuators.saturating_mul(2 * worst_case_bits(8));
        Traffic { bits_per_period, ..Traffic::default() }
    }

    fn from_keys(keys: &dyn Keys) -> Self {
        Self {
            model: *MODELS
                .get(keys.choice("model", &MODELS.map(|model| model.name)))
                .unwrap_or(&MODELS[0]),
            answers_from: or(keys, "master_id", AnswerId::Own, |key| {
                AnswerId::Master(keys.integer(key, MASTER_IDS) as u16)
            }),
        }
    }

    fn check_settings(&self, report: &mut dyn Report) {
        if let AnswerId::Master(id) = self.answers_from {
            check_integer(report, "master_id", id.into(), MASTER_IDS, "");
        }
    }

    fn explain_range(&self, quantity: &'static str, report: &mut dyn FnMut(Arguments<'_>)) {
        let Model { max_speed_rad_s, max_torque_nm, .. } = self.model;
        match quantity {
            "position" => report(format_args!("give a position within ±{MAX_POSITION_RAD} rad")),
            "speed" => report(format_args!("give at most {max_speed_rad_s} rad/s")),
            "torque" => report(format_args!("give at most {max_torque_nm} N·m")),
            _ => {}
        }
    }
}

impl CanCodec for Mit {
    fn decode(&self, received: &Frame) -> Option<(u8, Feedback)> {
        let [id, p1, p0, v, v_t, t, rest @ ..] = received.data() else { return None };
        let from = match self.answers_from {
            AnswerId::Master(master) => master,
            AnswerId::Own => u16::from(*id),
        };
        if received.standard_id() != Some(from) {
            return None;
        }
        let speed = u16::from(*v) << 4 | u16::from(v_t >> 4);
        let torque = u16::from(v_t & 0xF) << 8 | u16::from(*t);
        // Answers have six bytes, or eight. A seventh byte alone is the mini cheetah's supply voltage.
        let (temperature_c, faults) = match rest {
            [temperature, error] => (Some(f32::from(*temperature)), Some(faults_of(*error))),
            _ => (None, None),
        };
        let feedback = Feedback {
            position_rad: Some(POSITION.decode(u16::from_be_bytes([*p1, *p0]))),
            speed_rad_s: Some(self.speed().decode(speed)),
            torque_nm: Some(self.torque().decode(torque)),
            temperature_c,
            voltage_v: None,
            enabled: None,
            faults,
        };
        Some((*id, feedback))
    }
}
