//! Runs `visibility_fuzz::plans` in libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    visibility_fuzz::plans::run(bytes);
});
