//! Tests that the program `bake` is killed at random moments, goes on each time, and in the end writes the
//! same bytes as if it had never been killed.

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
    command.args(["london:2,2", "--cells", "walks", "--size", "16,16,4", "--gap", "100%", "--save", "0.02"]);
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
    assert!(bake(&whole, "1").wait().unwrap().success(), "the bake that is not killed succeeds");

    let state = folder.join("killed.pvs.state");
    let mut random = Random(23);
    let (mut kills, mut resumed) = (0, 0);
    // Contents of the state after each kill. Work adds to them, and takes away what was open.
    let mut states = Vec::new();
    while kills < KILLS {
        let mut running = bake(&killed, ["1", "2"][kills % 2]);
        // Until the state has been written once or twice, and a moment more.
        let (mut writes, mut last) = (1 + random.below(2), fs::read(&state).ok());
        while writes > 0 && running.try_wait().unwrap().is_none() {
            let now = fs::read(&state).ok();
            writes -= usize::from(now.is_some() && now != last);
            last = now;
            sleep(Duration::from_millis(1));
        }
        sleep(Duration::from_micros(random.below(30_000) as u64));
        if let Some(status) = running.try_wait().unwrap() {
            // It was quicker, on a machine that is busy with other things. It begins anew.
            assert!(
                status.success() && !state.exists(),
                "the bake that was quicker has succeeded, and removed its state"
            );
            fs::remove_file(&killed).unwrap();
            states.clear();
            continue;
        }
        running.kill().unwrap();
        if running.wait().unwrap().success() {
            continue;
        }
        kills += 1;
        resumed += usize::from(!states.is_empty());
        let now = fs::read(&state).ok();
        assert!(killed.exists() || now.is_some() && !states.contains(&now), "work that was done is kept");
        states.push(now);
    }
    assert!(resumed >= KILLS / 2, "{resumed} of {KILLS} went on");

    assert!(bake(&killed, "2").wait().unwrap().success(), "the bake that was killed succeeds");
    assert!(fs::read(&killed).unwrap() == fs::read(&whole).unwrap(), "other bytes");
    assert!(!state.exists(), "the state is removed when the work is done");
}
