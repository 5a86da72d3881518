//! Runs `visibility_fuzz::baked_sets` in libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    visibility_fuzz::baked_sets::run(bytes);
});
