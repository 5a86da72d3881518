//! Tests that the program `bake` is killed at random moments, goes on each time, and in the end writes the
//! same bytes as if it had never been killed.
#![allow(missing_docs)]

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;
use visibility_testing::Random;

const KILLS: usize = 10;

/// Starts a bake of some seconds' work, which writes its state often.
fn bake(out: &Path, threads: &str) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bake"));
    command.args(["london:2,2", "--size", "16,16,4", "--gap", "100%", "--save", "0.02"]);
    command.args(["--threads", threads, "-o"]).arg(out).stdout(Stdio::null());
    command.spawn().expect("the program starts")
}

#[test]
fn a_bake_that_is_killed_ten_times_has_the_bytes_of_one_that_is_not() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bake_kills");
    // Left by a run of this test that failed.
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let [whole, killed] = ["whole.pvs", "killed.pvs"].map(|name| folder.join(name));
    assert!(bake(&whole, "1").wait().unwrap().success());

    let state = folder.join("killed.pvs.state");
    let mut random = Random(23);
    let (mut resumed, mut sizes) = (0, Vec::new());
    for kill in 0..KILLS {
        resumed += usize::from(state.exists());
        let mut running = bake(&killed, ["1", "2"][kill % 2]);
        // Until the state has been written some times, and a moment more.
        let (mut writes, mut last) = (1 + random.below(2), fs::read(&state).ok());
        while writes > 0 && running.try_wait().unwrap().is_none() {
            let now = fs::read(&state).ok();
            writes -= usize::from(now.is_some() && now != last);
            last = now;
            sleep(Duration::from_millis(1));
        }
        sleep(Duration::from_micros(random.below(30_000) as u64));
        assert!(running.try_wait().unwrap().is_none(), "the bake is too short to be killed {KILLS} times");
        running.kill().unwrap();
        running.wait().unwrap();
        sizes.push(fs::metadata(&state).unwrap().len());
    }
    assert_eq!(resumed, KILLS - 1, "each run but the first went on");
    assert!(sizes.is_sorted() && sizes[0] < sizes[KILLS - 1], "work that was done is kept: {sizes:?}");
    assert!(!killed.exists(), "what is not finished is not there");

    assert!(bake(&killed, "2").wait().unwrap().success());
    assert!(fs::read(&killed).unwrap() == fs::read(&whole).unwrap(), "other bytes");
    assert!(!state.exists(), "the state is removed when the work is done");
}
