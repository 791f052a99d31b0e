//! libFuzzer program for [`rollwalk_fuzz::actuators`].
#![no_main]

rollwalk_fuzz::program!(actuators);
