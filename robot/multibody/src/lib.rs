//! Kinematics and dynamics of any robot file, shared by planner, simulators and controllers.
//!
//! A [`Tree`] is a robot prepared once. A configuration gives the poses of its links ([`Frames`]); velocities give their motion
//! ([`Kinematics`]). Both give the mass matrix ([`CompositeInertia`]), the bias forces ([`Kinematics::inverse_dynamics`]) and
//! the kinematics of contact points ([`RimContact`]).
//!
//! Generalised velocities ν have this order: linear velocity of the base origin (m/s) and angular velocity of the base (rad/s),
//! both in world axes; joint speeds in joint order (rad/s); speeds of the spinning wheels relative to their links, about the
//! axis of the robot file, in end-effector order (rad/s). Generalised forces are dual to them. [`euler`] has the coordinates of
//! the planner: base position, yaw–pitch–roll, joint angles. [`ground`] has solids for a simulator and heights for a planner.
//!
//! Accelerations and forces follow Featherstone, *Rigid Body Dynamics Algorithms* (RBDA), with ordinary 3-vectors in world
//! axes. There are no transforms between link frames, and each intermediate result is a velocity, force or moment.
//!
//! Vectors and matrices of the caller must have the size of the tree: [`Tree::dofs`], and one angle for each joint. Control
//! loops reuse them, so functions panic on a wrong size instead of returning an error.
//!
//! ```
//! use nalgebra::Vector3;
//! use rollwalk_multibody::{Kinematics, LINEAR, State, Tree};
//!
//! let text = std::fs::read_to_string("../../shipped/robots/agilebot.toml")?;
//! let robot = rollwalk_robot::Robot::from_toml("agilebot.toml", &text)?;
//! let tree = Tree::new(&robot);
//! let state = State::nominal(&tree);
//! let mut kinematics = Kinematics::new(&tree, &state.configuration());
//! kinematics.update(&tree, &state.configuration(), &state.velocity);
//! kinematics.accelerate(&tree, &vec![0.0; tree.dofs()]);
//!
//! // At rest, the ground must carry the weight.
//! let mut force = vec![0.0; tree.dofs()];
//! kinematics.inverse_dynamics(&tree, &Vector3::new(0.0, 0.0, -9.806_65), &mut force);
//! assert!((force[LINEAR + 2] - 9.806_65 * tree.total_mass_kg()).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

mod centroidal;
pub mod clearance;
mod composite;
mod contact;
pub mod distance;
pub mod euler;
mod frames;
pub mod ground;
mod inverse_dynamics;
mod jacobian;
mod kinematics;
pub mod parts;
mod passive;
pub mod rotation;
mod standing;
mod state;
mod tree;
mod warnings;
mod wheel_body;

pub use centroidal::{about_com, centroidal_momentum_matrix};
pub use composite::{CompositeInertia, forward_dynamics};
pub use contact::{ContactMotion, RimContact};
pub use frames::{Configuration, Frames};
pub use kinematics::Kinematics;
pub use passive::{PassiveLoad, passive_loads};
pub use standing::{Standing, StandingContact};
pub use state::{State, turn_base};
pub use tree::{Tree, Wheel};
pub use warnings::warnings;
pub use wheel_body::{RigidPart, WHEEL_MASS_SHARE, rest_of_link, spinning_wheels};

/// Index in ν of the first component of the base's linear velocity.
pub const LINEAR: usize = 0;
/// Index in ν of the first component of the base's angular velocity.
pub const ANGULAR: usize = 3;
/// Index of the first joint speed in ν, and of the first joint angle in the planner's `q`.
pub const JOINTS: usize = 6;
