//! Tests of the firmware core through its public interface, with a small robot and a library made by the protocol's encoder.

mod arming;
#[cfg(feature = "authenticated")]
mod attacks;
#[cfg(feature = "authenticated")]
mod authentication;
mod documentation;
mod drives;
mod examples;
mod feed_forward;
mod flash;
mod hostile;
mod journal;
mod link;
mod loads;
mod parameters;
mod pausing;
mod playback;
mod protocols;
mod rig;
mod robot;
mod scars;
mod stimuli;
mod stopping;
mod streaming;
mod tilt;
mod torque;
mod tracking;
mod transfer;
