//! Tests of the firmware core through its public face, with a small robot and a library made by the
//! protocol's encoder.

mod documentation;
mod hostile;
mod playback;
mod rig;
mod robot;
mod safety;
mod transfer;
