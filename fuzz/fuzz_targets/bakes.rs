//! Runs `visibility_fuzz::bakes` in libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    visibility_fuzz::bakes::run(bytes);
});
