//! Motion goals: duration, footfall pattern, displacement, boundary conditions, targets.
//!
//! Motion files (`motions/*.toml`, docs/motion-files.md) are read by [`Motion::from_toml`].

mod choreography;
mod choreography_check;
mod choreography_file;
pub(crate) mod file;
mod footfall;
mod moment;
mod phases;
pub(crate) mod swing;
mod wheels;

pub use choreography::{HeightLimit, Subject, Target};
pub use footfall::gaits;
pub use moment::Moment;

use rollwalk_multibody::ground::ElevationMap;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A motion goal, resolved against a robot: everything the optimiser needs besides the robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Name of the motion.
    pub name: String,
    /// Duration H, s; for periodic motions the period.
    pub duration_s: f64,
    /// Boundary conditions at the ends of the motion.
    pub ends: Ends,
    /// Contact flags c of Eq. 2.7: `stance[sample][end_effector]`. Its length is the sample count T.
    pub stance: Vec<Vec<bool>>,
    /// Height w_h that a foot in swing reaches, m (Eq. 2.9).
    pub swing_height_m: f64,
    /// Displacement and turn over the motion.
    pub goal: Goal,
    /// Joint angles that the posture term pulls towards, rad, in joint order: the robot's nominal ones unless the
    /// motion file gives others.
    pub posture_rad: Vec<f64>,
    /// Flags of the end effectors whose motor-actuated wheel the motion holds still, in robot order: such a wheel is a
    /// foot that rolls only as its link turns (LegBot, thesis sec. 3.5.2).
    pub held_wheels: Vec<bool>,
    /// Positions, velocities and headings required at chosen times.
    pub targets: Vec<Target>,
    /// Height limits over spans of time.
    pub heights: Vec<HeightLimit>,
    /// Shares of the motors' torque and speed that the motion may use.
    #[serde(default)]
    pub reserve: Reserve,
    /// Ground on which the robot moves, in the frame in which the motion begins at the origin, heading along x. Motion files
    /// have level ground, and files of plans name none.
    #[serde(skip)]
    pub ground: ElevationMap,
    /// Reason why the motion does not hold without feedback, by its author for its users; `None` if it holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub needs_feedback: Option<String>,
}

impl Motion {
    /// Sample spacing h, s.
    pub fn interval_s(&self) -> f64 {
        let samples = self.stance.len();
        let intervals = if self.ends == Ends::Periodic { samples } else { samples - 1 };
        self.duration_s / intervals as f64
    }

    /// Time at which a transition leaves the motion, s: its end, or for a periodic motion the start of a cycle, where
    /// the cycle closes.
    pub fn exit_time_s(&self) -> f64 {
        if self.ends == Ends::Periodic { 0.0 } else { self.duration_s }
    }

    /// Contact flags where a transition leaves the motion.
    pub fn exit_stance(&self) -> Option<&Vec<bool>> {
        if self.ends == Ends::Periodic { self.stance.first() } else { self.stance.last() }
    }

    /// Contact flags where a transition enters the motion: at its start.
    pub fn entry_stance(&self) -> Option<&Vec<bool>> {
        self.stance.first()
    }
}

/// Boundary conditions (thesis sec. 2.4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ends {
    /// The motion repeats, moved and turned by its own displacement.
    Periodic,
    /// The robot stands still at both ends.
    AtRest,
    /// Transition of a motion graph: both ends are states of other motions.
    Prescribed,
}

impl fmt::Display for Ends {
    /// Writes the word that motion files use.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Periodic => "periodic",
            Self::AtRest => "at_rest",
            Self::Prescribed => "prescribed",
        })
    }
}

/// Shares of the motors that plans may use. What is left is for feedback, and for what the model does not know.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reserve {
    /// Share of the torque limits of the joints' motors.
    pub torque_use: f64,
    /// Share of the speed limits of joints and wheels.
    pub speed_use: f64,
}

impl Default for Reserve {
    /// Torque, because servos correct with it. `pronk` has no plan with 5 % less speed.
    fn default() -> Self {
        Self { torque_use: 0.8, speed_use: 1.0 }
    }
}

/// Functional objectives. `None` leaves the optimiser free.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// Displacement along the starting heading over the motion, m.
    pub forward_m: Option<f64>,
    /// Displacement to the left of the starting heading over the motion, m.
    pub left_m: Option<f64>,
    /// Change of heading over the motion, rad, positive to the left.
    pub turn_rad: Option<f64>,
}
