//! The `rollwalk` command line.
fn main() {}
