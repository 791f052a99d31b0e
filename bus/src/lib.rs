//! The buses, as programs on a computer see them: frames over whatever carries them, and logs of them.
//!
//! | module | is |
//! |---|---|
//! | [`link`] | the trait: a bus with the controller on it, seen from the host |
//! | [`serial`] | the link over a serial line |
//! | [`lossy`] | a link that loses frames, for tests |
//! | [`candump`] | logs in the format of can-utils |

pub mod candump;
pub mod link;
pub mod lossy;
pub mod serial;
