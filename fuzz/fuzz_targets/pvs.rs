//! Runs `visibility_fuzz::pvs` in libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    visibility_fuzz::pvs::run(bytes);
});
