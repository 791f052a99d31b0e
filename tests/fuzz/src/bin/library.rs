//! libFuzzer program for [`rollwalk_fuzz::library`].
#![no_main]

rollwalk_fuzz::program!(library);
