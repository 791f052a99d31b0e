//! Fuzz targets, one per module. `run` of a target runs an input of the fuzzer, and panics if a property is violated. `seeds`
//! returns the initial inputs.
//!
//! | module | target |
//! |---|---|
//! | [`wire`] | frames and messages of the link: decoded ones encode to the same bytes |
//! | [`dispatcher`] | a controller in all situations |
//! | [`isotp`] | the transport of long messages, on a bus that loses, repeats and forges frames |
//! | [`deframer`] | packets on serial lines, among noise |
//! | [`actuators`] | every actuator protocol: orders and answers |
//! | [`library`] | validation and playback of motion libraries |
//! | [`slots`] | the library store in flash, from any content, with power cuts |
//! | [`parameters`] | the memory for gains and limits in flash, from any content, with power cuts |
//! | [`planted`] | a deliberate bug, which a working fuzzer finds |
//!
//! `cargo xtask fuzz` builds and runs them. Each program in `src/bin/` is libFuzzer around one module.

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

// The bench of the firmware's tests, unchanged.
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
#[path = "../../../firmware/tests/integration/stimuli.rs"]
#[allow(missing_docs)]
pub mod stimuli;
use rollwalk_firmware::store;

#[doc(hidden)]
pub use libfuzzer_sys;

/// Defines the program of a target: libFuzzer's `main` around a module of this crate.
#[macro_export]
macro_rules! program {
    ($target:ident) => {
        $crate::libfuzzer_sys::fuzz_target!(
            init: $crate::seeds::write_if_asked($crate::$target::seeds),
            |data: &[u8]| $crate::$target::run(data)
        );
    };
}
