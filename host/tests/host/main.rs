//! Tests of the operator's end through its public face.

mod dbc;
mod dbc_cantools;
mod dbc_frames;
