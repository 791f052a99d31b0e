//! Motion goals: duration, footfall pattern, displacement, boundary conditions and targets.
//!
//! [`Motion::from_toml`] reads motion files (`motions/*.toml`, docs/motion-files.md).

mod choreography;
mod choreography_check;
mod choreography_file;
mod feet;
pub(crate) mod file;
mod footfall;
mod footing;
mod lying;
mod moment;
mod patterns;
mod phases;
mod stretch;
pub(crate) mod swing;
mod timing;
mod warnings;
mod wheels;

pub use choreography::{HeightLimit, Subject, Target};
pub use footfall::gaits;
pub use footing::{Border, ContactMargins, Footing, MotionTerrain, Patch, Stand};
pub use moment::Moment;
pub use patterns::{Pattern, PatternKind};
pub use timing::{FreeTimes, Timing};

use rollwalk_multibody::ground::Terrain;
use rollwalk_protocol::library::{MAX_CLIP_FRAMES, RATE_HZ};
use rollwalk_robot::Robot;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Longest duration of a motion, s.
pub const LONGEST_S: f64 = MAX_CLIP_FRAMES as f64 / RATE_HZ as f64;

/// Motion goal, resolved against a robot. Robot and motion determine the optimisation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Name of the motion.
    pub name: String,
    /// Duration H, s; the period of a periodic motion.
    pub duration_s: f64,
    /// Boundary conditions at the ends of the motion.
    pub ends: Ends,
    /// Contact flags c of Eq. 2.7: `stance[sample][end_effector]`. The length is the sample count T.
    pub stance: Vec<Vec<bool>>,
    /// Height w_h of a swing, m (Eq. 2.9).
    pub swing_height_m: f64,
    /// Displacement and turn over the motion.
    pub goal: Goal,
    /// Joint angles of the posture cost, rad, in joint order. Defaults are the robot's nominal angles.
    pub posture_rad: Vec<f64>,
    /// Joint angles while the body lies on the ground, rad, in joint order. `None` if it never does. Stance flags and held wheels
    /// then include the points of [`Motion::robot`] on which the body lies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lying_rad: Option<Vec<f64>>,
    /// Flags of the end effectors whose actuated wheel the motion holds still, in robot order. A held wheel is a foot that
    /// rolls only as its link turns (LegBot, thesis sec. 3.5.2).
    pub held_wheels: Vec<bool>,
    /// Positions, velocities and headings required at chosen times.
    pub targets: Vec<Target>,
    /// Height limits over spans of time.
    pub heights: Vec<HeightLimit>,
    /// Fractions of the motors' torque and speed that the motion may use.
    #[serde(default)]
    pub reserve: Reserve,
    /// Terrain, in the frame in which the motion begins at the origin and heads along x. `None` for level ground.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terrain: Option<MotionTerrain>,
    /// Ground that follows from the terrain and the robot.
    #[serde(skip)]
    pub ground: Footing,
    /// Reason why the motion fails without feedback, from the motion file. `None` if it needs no feedback.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub needs_feedback: Option<String>,
    /// Times that [`crate::timing`] may change. Other entry points of the planner keep all times.
    #[serde(default, skip_serializing_if = "Timing::is_given")]
    pub timing: Timing,
}

impl Motion {
    /// Sample spacing h, s.
    pub fn interval_s(&self) -> f64 {
        let samples = self.stance.len();
        let intervals = if self.ends == Ends::Periodic { samples } else { samples - 1 };
        self.duration_s / intervals as f64
    }

    /// Sets the terrain of the motion, and derives the footing of a robot's end effectors from it.
    pub fn set_terrain(&mut self, terrain: Terrain, margins: ContactMargins, robot: &Robot) {
        let count = robot.end_effectors.len();
        let rolls: Vec<bool> = (0..count)
            .map(|j| self.stance.iter().all(|flags| flags[j]) && !self.held_wheels[j])
            .collect();
        self.terrain = Some(MotionTerrain { toml: terrain.toml.clone(), margins });
        self.ground = Footing::on(terrain, &margins, robot, &rolls);
    }

    /// Time at which a transition leaves the motion, s: the end of the motion, or 0 for a periodic motion, whose cycle closes
    /// there.
    pub fn exit_time_s(&self) -> f64 {
        if self.ends == Ends::Periodic { 0.0 } else { self.duration_s }
    }

    /// Contact flags at the exit of a transition from the motion.
    pub fn exit_stance(&self) -> Option<&Vec<bool>> {
        if self.ends == Ends::Periodic { self.stance.first() } else { self.stance.last() }
    }

    /// Contact flags at the entry of a transition to the motion, which is the start of the motion.
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
    /// Prints the value of `ends` as in motion files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Periodic => "periodic",
            Self::AtRest => "at_rest",
            Self::Prescribed => "prescribed",
        })
    }
}

/// Fractions of the motors' limits that plans may use. The rest is a reserve for feedback and model errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reserve {
    /// Fraction of the torque limits of the joints' motors.
    pub torque_use: f64,
    /// Fraction of the speed limits of joints and wheels.
    pub speed_use: f64,
}

impl Default for Reserve {
    /// Reserves torque, because servos correct with it. Speed has no reserve: with 5 % less, `pronk` has no plan.
    fn default() -> Self {
        Self { torque_use: 0.8, speed_use: 1.0 }
    }
}

/// Functional objectives. The optimiser is free in components that are `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// Displacement along the initial heading over the motion, m.
    pub forward_m: Option<f64>,
    /// Displacement to the left of the initial heading over the motion, m.
    pub left_m: Option<f64>,
    /// Change of heading over the motion, rad, positive to the left.
    pub turn_rad: Option<f64>,
}
