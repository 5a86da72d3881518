//! Runs `visibility_fuzz::prt` in libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    visibility_fuzz::prt::run(bytes);
});
