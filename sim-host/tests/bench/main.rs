//! The simulated robot end to end: a library flashed over the bus and played by code.

mod robot;
mod standing;
