//! Robot and motions for libraries in tests.

use rollwalk_protocol::config::{Channel, ChannelKind, RobotConfig, robot_id};
use rollwalk_protocol::library::{LibrarySpec, MotionSpec, TransitionSpec, encode};

/// Joint with limits of ±1.5 rad and 6 rad/s.
pub fn joint(id: u8) -> Channel {
    Channel {
        kind: ChannelKind::JointPosition,
        min: -1.5,
        max: 1.5,
        max_rate: 6.0,
        max_torque_nm: 3.0,
        kp_nm_rad: 20.0,
        kd_nm_s_rad: 0.5,
        bus: 0,
        id,
    }
}

/// Wheel with limits of ±8 rad/s and 60 rad/s².
pub fn wheel(id: u8) -> Channel {
    Channel {
        kind: ChannelKind::WheelSpeed,
        min: -8.0,
        max: 8.0,
        max_rate: 60.0,
        max_torque_nm: 1.0,
        kp_nm_rad: 0.0,
        kd_nm_s_rad: 0.2,
        bus: 1,
        id,
    }
}

/// Robot with `joints` joints, then `wheels` wheels.
pub fn robot(joints: u8, wheels: u8) -> RobotConfig {
    let channels = (0..joints).map(joint).chain((0..wheels).map(wheel)).collect();
    RobotConfig { robot: robot_id("fixture"), channels }
}

/// Concatenates `count` frames.
pub fn frames(count: usize, frame: impl Fn(usize) -> Vec<f32>) -> Vec<f32> {
    (0..count).flat_map(frame).collect()
}

/// Three motions of a robot with two joints and a wheel: `stand` (SAFE, one frame), `trot` (looping) and `drive` (ends), with
/// transitions between `stand` and each of the others.
pub struct Fixture {
    pub config: RobotConfig,
    pub stand: Vec<f32>,
    pub trot: Vec<f32>,
    pub drive: Vec<f32>,
    pub to_trot: Vec<f32>,
    pub from_trot: Vec<f32>,
    pub to_drive: Vec<f32>,
    pub from_drive: Vec<f32>,
    /// Torques of each clip, motions first; empty if there are none.
    pub torques: [Vec<f32>; 7],
}

/// Frames from the pose `from` to the pose `to`, with zero speed at both ends.
pub fn blend(count: usize, from: &[f32], to: &[f32]) -> Vec<f32> {
    frames(count, |k| {
        let s = k as f32 / (count - 1) as f32;
        let s = s * s * (3.0 - 2.0 * s);
        from.iter().zip(to).map(|(a, b)| a + s * (b - a)).collect()
    })
}

pub const TROT_EXIT: u16 = 70;

impl Fixture {
    pub fn new() -> Self {
        let config = robot(2, 1);
        let stand = vec![0.5, -1.0, 0.0];
        let trot_at = |k: usize| {
            let phase = std::f32::consts::TAU * k as f32 / 90.0;
            vec![0.5 + 0.3 * phase.sin(), -1.0 + 0.2 * phase.cos(), 4.0 + phase.sin()]
        };
        let drive_at = |k: usize| {
            let s = std::f32::consts::PI * k as f32 / 129.0;
            vec![0.5, -1.0 + 0.1 * s.sin(), 5.0 * s.sin()]
        };
        Self {
            to_trot: blend(40, &stand, &trot_at(0)),
            from_trot: blend(40, &trot_at(usize::from(TROT_EXIT)), &stand),
            to_drive: blend(2, &stand, &stand),
            from_drive: blend(20, &stand, &stand),
            trot: frames(90, trot_at),
            drive: frames(130, drive_at),
            stand,
            config,
            torques: Default::default(),
        }
    }

    /// Creates the fixture with torques: those of stiff springs, and for the trot also steps, as at ground contact.
    pub fn with_torques() -> Self {
        let mut fixture = Self::new();
        let f = &fixture;
        let clips =
            [&f.stand, &f.trot, &f.drive, &f.to_trot, &f.from_trot, &f.to_drive, &f.from_drive];
        let torques = clips.map(|values| {
            let torque = |(i, value): (usize, &f32)| {
                let limit = f.config.channels[i % 3].max_torque_nm;
                let step = if values.len() == f.trot.len() && i / 3 % 45 < 20 { 0.4 } else { -0.1 };
                limit * (0.5 * (3.0 * value).sin() + step)
            };
            values.iter().enumerate().map(torque).collect()
        });
        fixture.torques = torques;
        fixture
    }

    pub fn motions(&self) -> [MotionSpec<'_>; 3] {
        [
            MotionSpec {
                name: "stand",
                code: 1,
                looping: true,
                frames: &self.stand,
                torques: &self.torques[0],
            },
            MotionSpec {
                name: "trot",
                code: 20,
                looping: true,
                frames: &self.trot,
                torques: &self.torques[1],
            },
            MotionSpec {
                name: "drive",
                code: 10,
                looping: false,
                frames: &self.drive,
                torques: &self.torques[2],
            },
        ]
    }

    pub fn transitions(&self) -> [TransitionSpec<'_>; 4] {
        let [.., to_trot, from_trot, to_drive, from_drive] = &self.torques;
        [
            TransitionSpec { torques: to_trot, ..TransitionSpec::new(0, 0, 1, 0, &self.to_trot) },
            TransitionSpec {
                torques: from_trot,
                ..TransitionSpec::new(1, TROT_EXIT, 0, 0, &self.from_trot)
            },
            TransitionSpec { torques: to_drive, ..TransitionSpec::new(0, 0, 2, 0, &self.to_drive) },
            TransitionSpec {
                torques: from_drive,
                ..TransitionSpec::new(2, 129, 0, 0, &self.from_drive)
            },
        ]
    }

    pub fn encode(&self) -> Vec<u8> {
        let (motions, transitions) = (self.motions(), self.transitions());
        let spec = LibrarySpec {
            config: &self.config,
            motions: &motions,
            transitions: &transitions,
            safe: 0,
        };
        encode_vec(&spec)
    }
}

/// Encodes a specification that must be valid.
pub fn encode_vec(spec: &LibrarySpec<'_>) -> Vec<u8> {
    let mut out = vec![0xA5; 1 << 20];
    let len = encode(spec, &mut out).unwrap_or_else(|error| panic!("{error}"));
    out.truncate(len);
    out
}
