//! Integration tests of designs with their motions: one binary, one module per subject.

mod agilebot;
mod reference;
