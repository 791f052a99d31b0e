//! libFuzzer around [`rollwalk_fuzz::slots`].
#![no_main]

rollwalk_fuzz::program!(slots);
