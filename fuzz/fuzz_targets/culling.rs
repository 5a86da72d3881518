//! Runs `visibility_fuzz::culling` in libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    visibility_fuzz::culling::run(bytes);
});
