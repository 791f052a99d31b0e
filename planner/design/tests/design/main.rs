//! Robots under design, with their motions: one binary, one module per subject.

mod agilebot;
mod reference;
