//! Runs `visibility_fuzz::scene_files` in libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    visibility_fuzz::scene_files::run(bytes);
});
