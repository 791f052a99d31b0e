//! Tests of the firmware core through its public face, with a small robot and a library made by the
//! protocol's encoder.

mod documentation;
mod playback;
mod robot;
