//! Engine of the studio: reads the documents of a robot and its motions, and returns scenes, plans and faults.
//!
//! A [`Session`] answers requests of a page (JSON, [`messages`]). It uses no clock, files or threads. There are two interfaces
//! to it: `door` in a page, as WebAssembly; and a WebSocket of `rollwalk studio`, which runs the engine natively. Every edit
//! changes the text of a document, which is then validated. The studio thus plans exactly the same as the command line.

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
