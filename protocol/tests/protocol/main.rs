//! Tests of the crate's boundaries, from outside.

mod fixture;
mod library_round_trip;
