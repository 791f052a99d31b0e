//! libFuzzer around [`rollwalk_fuzz::parameters`].
#![no_main]

rollwalk_fuzz::program!(parameters);
