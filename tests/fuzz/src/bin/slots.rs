//! libFuzzer program for [`rollwalk_fuzz::slots`].
#![no_main]

rollwalk_fuzz::program!(slots);
