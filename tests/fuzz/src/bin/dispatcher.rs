//! libFuzzer program for [`rollwalk_fuzz::dispatcher`].
#![no_main]

rollwalk_fuzz::program!(dispatcher);
