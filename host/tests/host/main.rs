//! Tests of the host crate through its public interface.

mod dbc;
mod dbc_cantools;
mod dbc_frames;
mod examples;
