//! Runs `visibility_fuzz::level_occluders` in libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    visibility_fuzz::level_occluders::run(bytes);
});
