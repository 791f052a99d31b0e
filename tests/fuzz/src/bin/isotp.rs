//! libFuzzer program for [`rollwalk_fuzz::isotp`].
#![no_main]

rollwalk_fuzz::program!(isotp);
