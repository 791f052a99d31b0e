//! libFuzzer program for [`rollwalk_fuzz::planted`].
#![no_main]

rollwalk_fuzz::program!(planted);
