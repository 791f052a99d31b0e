//! The engine of the studio: documents of a robot and its motions in, scenes, plans and faults out.
//!
//! A [`Session`] answers requests (JSON, [`messages`]) of a page. It reads no clock, no file and has no threads. Two doors lead
//! to it: `door` in a page, as WebAssembly; and a WebSocket of `rollwalk studio`, which runs it natively. Every edit goes
//! through the text of its document and that document's validation, so that the studio plans what the command line plans, and
//! nothing else.

mod compare;
mod documents;
#[cfg(target_arch = "wasm32")]
mod door;
mod edit;
mod examples;
mod frames;
mod graph;
mod import;
mod library;
pub mod messages;
mod motion_view;
mod outcome;
pub mod robot;
mod scene;
mod session;
mod sliders;
mod slopes;

pub use session::Session;
