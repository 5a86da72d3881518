//! Test that the program `bake` takes no file for good that a full disk has cut short, and that a bake after
//! that has the bytes of one that had room enough. A limit on the size of files stands for the disk.
#![cfg(target_os = "linux")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Bakes a few viewcells into `set` and `cache` in a folder, with a state that is written often. Files end
/// after `blocks` blocks of 512 bytes, and writing beyond is an error.
fn bake(folder: &Path, blocks: &str) -> Output {
    let mut command = Command::new("sh");
    command.args(["-c", "trap '' XFSZ; ulimit -f $0; exec \"$@\"", blocks, env!("CARGO_BIN_EXE_bake")]);
    command.args(["london:1,1", "--cells", "walks", "--size", "24,24,4", "--gap", "100%", "--threads", "1"]);
    command.args(["--save", "0.005", "-o", "set", "--cache", "cache"]).current_dir(folder);
    command.output().expect("the program starts")
}

#[test]
fn a_full_disk_leaves_whole_files_and_a_bake_that_goes_on() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("full_disk");
    // Removes what a failed run of this test may have left.
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let [set, cache] = ["set", "cache"].map(|name| folder.join(name));
    let files = || [&set, &cache].map(|path| fs::read(path).ok());
    assert!(bake(&folder, "unlimited").status.success(), "a bake with room enough");
    let whole = files();
    let [set_size, cache_size] = whole.each_ref().map(|file| file.as_ref().map_or(0, Vec::len));
    assert!(512 < set_size && set_size < 4096 && cache_size > 4096, "{set_size} and {cache_size} bytes");

    // Room for neither file, for a part of the set, and for the set and a part of the cache.
    for (blocks, has_set) in [("0", false), ("1", false), ("8", true)] {
        fs::write(&set, b"old").unwrap();
        let _ = fs::remove_file(&cache);
        let full = bake(&folder, blocks);
        let said = String::from_utf8_lossy(&full.stderr);
        assert!(!full.status.success() && said.contains("cannot write"), "{blocks} blocks: {said}");
        let expected = if has_set { whole[0].clone() } else { Some(b"old".to_vec()) };
        assert!(files() == [expected, None], "{blocks} blocks: a file that is neither whole nor as before");
        let parts = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name());
        let parts: Vec<_> = parts.filter(|name| name.to_string_lossy().ends_with(".part")).collect();
        assert!(parts.is_empty(), "{blocks} blocks: {parts:?} are left");

        let after = bake(&folder, "unlimited");
        let said = String::from_utf8_lossy(&after.stderr);
        assert!(after.status.success(), "{blocks} blocks, and then room: {said}");
        assert!(files() == whole, "{blocks} blocks, and then room: other bytes");
    }
    fs::remove_dir_all(&folder).unwrap();
}
