//! Simulated robot without hardware: CAN buses and serial lines with virtual servos around the real firmware core, in virtual
//! time.
//!
//! | module | contents |
//! |---|---|
//! | [`rig`], [`store`] | controller, buses and motors, stepped in one fixed order |
//! | [`core`] | interface of a controller: the firmware in this process, or a controller elsewhere |
//! | [`mod@bus`], [`mod@line`] | a CAN bus and a half-duplex serial line, exact to the bit |
//! | [`interface`], [`clock`] | names of the buses, virtual time |
//! | [`body`], [`servo`], [`plant`], [`load`] | motors, from frame to torque to angle; their drives are [`rollwalk_drives`] |
//! | [`ground`] | the robot on the ground, in the world of [`rollwalk_physics`], with a hoist |
//! | [`live`] | in real time: the whole robot, its controller or its motors on buses of this computer |
//! | [`faults`] | scheduled faults of buses and actuators |
//! | [`one_leg`] | a small robot with a library, for tests and fault campaigns |
//! | [`record`] | set-points and measured values of every control period |
//!
//! The host is `rollwalk-host`, which treats a [`rig::Rig`] like any other robot. A [`rig::Observer`], such as the monitor of
//! the fault campaign, sees every frame of a run.
//!
//! The buses are simulated to the bit: arbitration, stuff bits, CRC and intermission on CAN; turns, return delays and collisions
//! on serial lines. The drives are simulated with protocols, watchdogs, control laws and limits. The robot is simulated either as
//! a whole on the ground, or on a stand. On the stand its body is held level and still, and its wheels are in the air. Each joint
//! moves the inertia and weight of its links without coupling to other joints.
//!
//! The simulation is deterministic: the same calls give the same bytes on every bus.
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
