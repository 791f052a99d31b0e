//! libFuzzer program for [`rollwalk_fuzz::parameters`].
#![no_main]

rollwalk_fuzz::program!(parameters);
