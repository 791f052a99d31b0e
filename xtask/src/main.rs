//! `cargo xtask`: what the README and CI run.
fn main() {}
