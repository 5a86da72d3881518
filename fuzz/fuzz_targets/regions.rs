//! Runs `visibility_fuzz::regions` in libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    visibility_fuzz::regions::run(bytes);
});
