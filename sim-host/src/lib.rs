//! A robot without hardware: simulated CAN buses and virtual servos around the real firmware core, in
//! virtual time; and the host's side of the link bus.
//!
//! What is simulated: the buses to the bit (arbitration, stuff bits, CRC, inter-frame space), the
//! servos' protocol, watchdog, control law and limits, and for every joint the inertia and weight of
//! what hangs on it. What is not: the ground, the motion of the body and the coupling between joints.
//! The robot hangs on a stand, its body held level and still, its wheels in the air.
//!
//! Everything is deterministic: the same calls give the same bytes on every bus.

pub mod bit_timing;
pub mod body;
pub mod bus;
pub mod candump;
pub mod client;
pub mod clock;
pub mod fault;
pub mod link;
pub mod load;
pub mod plant;
pub mod record;
pub mod refusal;
pub mod rig;
pub mod servo;
pub mod session;
pub mod store;
