//! libFuzzer program for [`rollwalk_fuzz::wire`].
#![no_main]

rollwalk_fuzz::program!(wire);
