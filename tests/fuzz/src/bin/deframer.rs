//! libFuzzer program for [`rollwalk_fuzz::deframer`].
#![no_main]

rollwalk_fuzz::program!(deframer);
