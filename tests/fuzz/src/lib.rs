//! Fuzz targets, one module each. Each has `run`, which takes the fuzzer's bytes and panics when a property is violated, and
//! `seeds`, the initial inputs.
//!
//! | module | fuzzes |
//! |---|---|
//! | [`wire`] | frames and messages of the link: decoded ones encode to the same bytes |
//! | [`dispatcher`] | a controller, and all that can happen to it |
//! | [`isotp`] | the transport of long messages, on a bus that loses, repeats and forges |
//! | [`deframer`] | packets on serial lines, among noise |
//! | [`actuators`] | every actuator protocol: orders, and what comes back |
//! | [`library`] | validation of motion libraries, and what plays of them |
//! | [`slots`] | the library store in flash, from any content, through power cuts |
//! | [`parameters`] | the memory for gains and limits in flash, likewise |
//! | [`planted`] | a bug that must be found, or the fuzzer is blind |
//!
//! `cargo xtask fuzz` builds and runs them; a program of `src/bin/` is libFuzzer around one module.

pub mod actuators;
pub mod authentication;
pub mod deframer;
pub mod dispatcher;
pub mod flash;
pub mod isotp;
pub mod library;
pub mod parameters;
pub mod planted;
pub mod seeds;
pub mod slots;
mod watched;
pub mod wire;

// The bench of the firmware's tests, as it is there.
#[path = "../../../firmware/tests/integration/deeds.rs"]
#[allow(missing_docs)]
pub mod deeds;
#[path = "../../../firmware/tests/integration/drives.rs"]
#[allow(missing_docs, dead_code)]
pub mod drives;
#[path = "../../../protocol/tests/protocol/encode_again.rs"]
#[allow(missing_docs)]
mod encode_again;
#[path = "../../../firmware/tests/integration/rig.rs"]
#[allow(missing_docs, dead_code)]
pub mod rig;
#[path = "../../../firmware/tests/integration/robot.rs"]
#[allow(missing_docs)]
pub mod robot;
use rollwalk_firmware::store;

#[doc(hidden)]
pub use libfuzzer_sys;

/// The program of a target: libFuzzer's `main` around a module of this crate.
#[macro_export]
macro_rules! program {
    ($target:ident) => {
        $crate::libfuzzer_sys::fuzz_target!(
            init: $crate::seeds::write_if_asked($crate::$target::seeds),
            |data: &[u8]| $crate::$target::run(data)
        );
    };
}
