//! Programs as they are called: readers that leave, and numbers that no program can keep or draw.

use std::process::{Command, Output, Stdio};

/// Runs a program whose standard output nobody reads, and returns what it wrote to standard error.
fn without_reader(program: &str, arguments: &str) -> Output {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut command = Command::new(program);
    command.args(arguments.split(' ')).stdout(writer).stderr(Stdio::piped());
    command.output().unwrap()
}

#[test]
fn programs_end_quietly_when_their_reader_leaves() {
    for (program, arguments) in [
        (env!("CARGO_BIN_EXE_region"), "plpcity:1,1 --cells 1 --eyes 1 --rays 10"),
        (env!("CARGO_BIN_EXE_walkthrough"), "plpcity:1,1 --frames 1 --size 8x8"),
        (env!("CARGO_BIN_EXE_bake"), "fingerprint plpcity:1,1"),
    ] {
        let output = without_reader(program, arguments);
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{program} {arguments} ends with {}: {error}", output.status);
    }
}

#[test]
fn numbers_beyond_what_can_be_kept_or_drawn_are_refused() {
    for (program, arguments, expected) in [
        (env!("CARGO_BIN_EXE_walkthrough"), "--frames 4000000000", "4000000000 is not in 1..=1000000"),
        (env!("CARGO_BIN_EXE_walkthrough"), "--frames 0", "0 is not in 1..=1000000"),
        (env!("CARGO_BIN_EXE_walkthrough"), "--size 0x0", "a side has at least 1 pixel"),
        (env!("CARGO_BIN_EXE_region"), "--cells 4000000000", "4000000000 is not in 1..=1000000"),
        (env!("CARGO_BIN_EXE_motion"), "--movers 4000000000", "4000000000 is not in 1..=1000000"),
    ] {
        let output = Command::new(program).args(arguments.split(' ')).output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{program} {arguments}: {error}");
        assert!(error.contains(expected), "{program} {arguments}: expected `{expected}` in: {error}");
    }
}
