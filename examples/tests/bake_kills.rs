//! Test that the program `bake`, killed at random moments and restarted each time, finally writes the same
//! bytes as without kills.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;
use visibility_testing::Random;

const KILLS: usize = 10;

/// Starts a bake that takes some seconds and writes its state often.
fn bake(out: &Path, threads: &str) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bake"));
    command.args(["london:2,2", "--cells", "walks", "--size", "16,16,4", "--gap", "100%", "--save", "0.02"]);
    command.args(["--threads", threads, "-o"]).arg(out).stdout(Stdio::null());
    command.spawn().expect("the program starts")
}

#[test]
fn a_bake_that_is_killed_ten_times_has_the_bytes_of_one_that_is_not() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bake_kills");
    // Removes what a failed run of this test may have left.
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let [whole, killed] = ["whole.pvs", "killed.pvs"].map(|name| folder.join(name));
    assert!(bake(&whole, "1").wait().unwrap().success(), "the bake that is not killed succeeds");

    let state = folder.join("killed.pvs.state");
    let mut random = Random(23);
    let (mut kills, mut resumed) = (0, 0);
    // State files after each kill. They change, since work adds results and removes undecided items.
    let mut states = Vec::new();
    while kills < KILLS {
        let mut running = bake(&killed, ["1", "2"][kills % 2]);
        // Waits until the state has been written once or twice, and a moment longer.
        let (mut writes, mut last) = (1 + random.below(2), fs::read(&state).ok());
        while writes > 0 && running.try_wait().unwrap().is_none() {
            let now = fs::read(&state).ok();
            writes -= usize::from(now.is_some() && now != last);
            last = now;
            sleep(Duration::from_millis(1));
        }
        sleep(Duration::from_micros(random.below(30_000) as u64));
        if let Some(status) = running.try_wait().unwrap() {
            // On a busy machine the bake may finish before it is killed. Then the next bake starts anew.
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
