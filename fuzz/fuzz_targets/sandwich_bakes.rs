//! Runs `visibility_fuzz::sandwich_bakes` in libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    visibility_fuzz::sandwich_bakes::run(bytes);
});
