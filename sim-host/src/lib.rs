//! A robot without hardware: simulated CAN buses and serial lines with virtual servos around the real firmware
//! core, in virtual time.
//!
//! | module | is |
//! |---|---|
//! | [`rig`], [`store`] | controller, buses and motors, stepped in one fixed order |
//! | [`core`] | the controller: firmware in this process, or anything else that answers its steps |
//! | [`mod@bus`], [`mod@line`] | a CAN bus and a half-duplex serial line, exact to the bit |
//! | [`interface`], [`clock`] | the buses' names, virtual time |
//! | [`body`], [`servo`], [`plant`], [`load`] | the motors, from frame to torque to angle; their drives are [`rollwalk_drives`] |
//! | [`ground`] | the robot on the ground, in the world of [`rollwalk_physics`], with a hoist |
//! | [`live`] | in real time: the whole robot, its controller or its motors on buses of this computer |
//! | [`faults`] | scheduled faults of buses and actuators |
//! | [`one_leg`] | a small robot with a library, for tests and fault campaigns |
//! | [`record`] | setpoints and measured values of every control period |
//!
//! The host's end is `rollwalk-host`, for which a [`rig::Rig`] is a robot like any other. A [`rig::Observer`],
//! such as the monitor of the fault campaign, sees every frame of a run.
//!
//! What is simulated: the buses to the bit (arbitration, stuff bits, CRC, intermission; on serial lines turns,
//! return delays and collisions), the drives' protocols, watchdogs, control laws and limits; and either
//! the whole robot on the ground, or for every joint the inertia and weight of what hangs on it. In the
//! latter case the robot hangs on a stand, its body held level and still, its wheels in the air, and no
//! joint feels another one move.
//!
//! Everything is deterministic: the same calls give the same bytes on every bus.
//!
//! ```
//! use rollwalk_bus::candump;
//! use rollwalk_host::session::Session;
//! use rollwalk_sim_host::{record, rig::Rig};
//!
//! /// Flashes a library, plays the motion with code 2 for three seconds, and logs every bus.
//! fn play(
//!     robot: &rollwalk_robot::Robot,
//!     library: &[u8],
//!     log: std::fs::File,
//! ) -> Result<(), Box<dyn std::error::Error>> {
//!     let rig = Rig::new(robot)?;
//!     let node = rig.node();
//!     let mut session = Session::connect(rig, node)?;
//!     session.flash(library, |progress| eprintln!("{} of {} bytes", progress.done, progress.total))?;
//!     session.arm()?;
//!     session.select(2)?;
//!     session.run_for(3_000_000)?;
//!     session.return_to_safe()?;
//!     session.disarm()?;
//!
//!     let rig = session.into_bus();
//!     for (clip, worst) in record::tracking_errors(rig.config(), rig.records()) {
//!         println!("clip {}: {:.1} mrad", clip.0, 1e3 * worst.joint_rad);
//!     }
//!     candump::write(rig.log(), std::io::BufWriter::new(log))?;
//!     Ok(())
//! }
//! ```

#![warn(missing_docs)]

pub mod body;
pub mod bus;
pub mod clock;
pub mod core;
pub mod faults;
pub mod ground;
pub mod interface;
pub mod line;
#[cfg(not(target_family = "wasm"))]
pub mod live;
pub mod load;
pub mod one_leg;
pub mod plant;
pub mod record;
pub mod rig;
pub mod servo;
pub mod store;
mod wire;
