//! Tests of the program `bake` from a user's point of view: files that it writes, arguments that it refuses,
//! and its final messages.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use visibility_core::glam::Vec3;
use visibility_examples::output_file::Lock;
use visibility_examples::vscn;
use visibility_examples::{SceneSource, SourceObject};

pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    // Removes what a failed run of this test may have left.
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

pub(crate) fn run(program: &str, folder: &Path, arguments: &[&str]) -> Output {
    Command::new(program).current_dir(folder).args(arguments).output().expect("the program starts")
}

fn bake(folder: &Path, arguments: &[&str]) -> Output {
    run(env!("CARGO_BIN_EXE_bake"), folder, arguments)
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Returns the names of the files in a folder, sorted.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<String> = names.map(|name| name.into_string().unwrap()).collect();
    names.sort();
    names
}

/// Writes a scene with a plate behind a wall. The wall is at y = 5 m and 20 by 8 m in size, and consists of
/// rectangles in x and z.
pub(crate) fn write_wall(path: &Path, rectangles: &[[f32; 4]]) {
    let at = |y: f32, [a, b, c, d]: [f32; 4]| {
        let corner = |x: f32, z: f32| Vec3::new(x, y, z);
        [[corner(a, c), corner(b, c), corner(b, d)], [corner(a, c), corner(b, d), corner(a, d)]]
    };
    let wall = rectangles.iter().flat_map(|&rectangle| at(5.0, rectangle)).collect::<Vec<_>>();
    let plate = at(9.0, [-0.4, 0.4, 0.0, 2.0]).to_vec();
    let objects = vec![SourceObject::new("wall", wall), SourceObject::new("plate", plate)];
    let scene = SceneSource { objects, ..SceneSource::new("wall", Vec3::Z, 0.01) };
    fs::write(path, vscn::write(&scene).unwrap()).unwrap();
}

pub(crate) const WHOLE: &[[f32; 4]] = &[[-10.0, 10.0, 0.0, 8.0]];
/// Wall with a door. Its bounds are those of the whole wall.
const DOOR: &[[f32; 4]] = &[[-10.0, -1.0, 0.0, 8.0], [1.0, 10.0, 0.0, 8.0], [-1.0, 1.0, 3.0, 8.0]];
const PLACES: [&str; 6] = ["--cells", "grid", "--over=-2,-4,0,2,0,2", "--size", "4,4,2", "--out"];

fn bake_wall(folder: &Path, out: &str, more: &[&str]) -> Output {
    bake(folder, &[&["wall.vscn"], &PLACES[..], &[out], more].concat())
}

#[test]
fn a_set_is_refused_once_a_door_is_cut_into_a_wall() {
    let folder = folder("bake_stale");
    write_wall(&folder.join("wall.vscn"), WHOLE);
    write_wall(&folder.join("door.vscn"), DOOR);
    let cameras = r#"{"name": "w", "up_axis": "z", "near": 0.05, "cameras": [{"name": "w", "fov_y_deg": 60,
        "up": [0, 0, 1], "keys": [{"eye": [0, -1, 1], "target": [0, 5, 1]}]}]}"#;
    fs::write(folder.join("walk.json"), cameras).unwrap();
    let baked = bake_wall(&folder, "wall.set", &["--cache", "wall.cache", "--json", "report.json"]);
    assert!(baked.status.success(), "{}", text(&baked.stderr));
    let walk = |scene: &str, more: &[&str]| {
        let arguments = ["--cameras", "walk.json", "--size", "64x36", "--cullers", "baked:wall.set"];
        let arguments = [&["--scene", scene], &arguments[..], more].concat();
        run(env!("CARGO_BIN_EXE_walkthrough"), &folder, &arguments)
    };
    let same = walk("wall.vscn", &[]);
    assert!(same.status.success(), "{}", text(&same.stderr));
    for refused in [walk("door.vscn", &[]), walk("wall.vscn", &["--hint", "detail=0"])] {
        assert!(!refused.status.success(), "{}", text(&refused.stdout));
        let said = text(&refused.stderr);
        assert!(said.contains("wall.set") && said.contains("bake again"), "{said}");
    }
    // The report names the same level version as the set.
    let set = visibility_bake::BakedSet::from_bytes(&fs::read(folder.join("wall.set")).unwrap()).unwrap();
    let version = format!("{:016x}", set.version());
    assert!(
        text(&baked.stdout).contains(&format!("version of the level: {version}")),
        "the program names the version {version}"
    );
    assert!(
        fs::read_to_string(folder.join("report.json")).unwrap().contains(&version),
        "the report has the version {version}"
    );
    // With the cache of the level before the edit, the result equals that of a bake without a cache.
    fs::copy(folder.join("door.vscn"), folder.join("wall.vscn")).unwrap();
    assert!(
        bake_wall(&folder, "cached.set", &["--cache", "wall.cache"]).status.success(),
        "the bake with the old cache succeeds"
    );
    assert!(bake_wall(&folder, "anew.set", &[]).status.success(), "the bake without a cache succeeds");
    let [cached, anew, before] =
        ["cached.set", "anew.set", "wall.set"].map(|name| fs::read(folder.join(name)).unwrap());
    assert!(
        cached == anew && anew != before,
        "the cached set is the one without a cache, and not the old one"
    );
}

#[test]
fn one_bake_at_a_time_writes_a_file() {
    let folder = folder("bake_twice");
    write_wall(&folder.join("wall.vscn"), WHOLE);
    let lock = Lock::new(&folder.join("two.set")).unwrap();
    let refused = bake_wall(&folder, "two.set", &[]);
    assert!(!refused.status.success(), "a bake of a file that is worked on is refused");
    assert!(text(&refused.stderr).contains("another program is at work on "), "{}", text(&refused.stderr));
    assert!(bake_wall(&folder, "other.set", &[]).status.success(), "a bake of another file succeeds");
    drop(lock);
    assert!(bake_wall(&folder, "two.set", &[]).status.success(), "a bake after the lock is gone succeeds");
    assert_eq!(names(&folder), ["other.set", "two.set", "wall.vscn"], "files left");
}

/// A folder in place of the state file stands for any state that is there and cannot be read: the finished
/// work in it is not replaced by a new bake.
#[test]
fn a_state_that_cannot_be_read_is_not_replaced() {
    let folder = folder("bake_state");
    write_wall(&folder.join("wall.vscn"), WHOLE);
    fs::create_dir(folder.join("wall.set.state")).unwrap();
    let output = bake_wall(&folder, "wall.set", &[]);
    let message = text(&output.stderr);
    assert!(!output.status.success(), "a bake whose state cannot be read fails");
    assert!(message.contains("wall.set.state"), "the message names the state: {message}");
    assert_eq!(names(&folder), ["wall.set.state", "wall.vscn"], "no set is written");
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_devices_stay() {
    use std::os::unix::fs::{FileTypeExt, symlink};
    let folder = folder("bake_links");
    write_wall(&folder.join("wall.vscn"), WHOLE);
    fs::create_dir(folder.join("there")).unwrap();
    symlink("there/real.set", folder.join("link.set")).unwrap();
    symlink("/dev/null", folder.join("null")).unwrap();
    for out in ["link.set", "null", "plain.set"] {
        let baked = bake_wall(&folder, out, &["--memory", "64M"]);
        assert!(baked.status.success(), "{out}: {}", text(&baked.stderr));
    }
    assert!(folder.join("link.set").is_symlink() && folder.join("null").is_symlink(), "links stay links");
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device(), "the device stays");
    let [real, plain] = ["there/real.set", "plain.set"].map(|name| fs::read(folder.join(name)).unwrap());
    assert!(real == plain && !real.is_empty(), "the linked set is the plain one");
    assert_eq!(
        names(&folder),
        ["link.set", "null", "plain.set", "there", "wall.vscn"],
        "files in the folder"
    );
    assert_eq!(names(&folder.join("there")), ["real.set"], "files behind the link");
}

#[test]
fn more_viewcells_than_can_be_kept_are_refused_with_their_number() {
    let folder = folder("bake_count");
    let refused = |size: &str, more: &[&str]| {
        let size = [size; 3].join(",");
        let refused = bake(&folder, &[&["plpcity:1,1", "--size", &size, "--out", "a.set"], more].concat());
        assert!(!refused.status.success(), "a size of {size} is refused");
        text(&refused.stderr)
    };
    for more in [&[][..], &["--over", "0,0,0,100,100,100"]] {
        let said = refused("0.0000001", more);
        let count = said.split_whitespace().find_map(|word| word.parse::<u128>().ok());
        assert!(count.is_some_and(|count| count > 1 << 24) && said.contains("viewcells"), "{said}");
    }
    // This many viewcells would fit into memory, but cannot be made within a second.
    let said = refused("0.0001", &["--time", "1"]);
    assert!(said.starts_with("error: the viewcells were not made in time: larger ones (--size)"), "{said}");
    assert!(names(&folder).is_empty(), "no file is left");
}

#[test]
fn the_last_lines_say_which_viewcells_miss_the_gap() {
    let folder = folder("bake_gap");
    // A grid is made however little time there is, also on a busy machine.
    let places = ["london:2,2", "--cells", "grid", "--over", "0,0,0,64,64,4", "--size", "16,16,4"];
    let files = ["--rays", "1", "--out", "a.set", "--json", "a.json"];
    let report = |more: &[&str]| {
        let baked = bake(&folder, &[&places[..], &files[..], more].concat());
        assert!(baked.status.success(), "{}", text(&baked.stderr));
        let json: serde_json::Value =
            serde_json::from_slice(&fs::read(folder.join("a.json")).unwrap()).unwrap();
        let asked = json["asked_gap"].as_f64().unwrap();
        let cells = json["viewcells"].as_array().unwrap();
        let over = cells.iter().filter(|cell| cell["gap"].as_f64().unwrap() > asked).count();
        assert_eq!(
            json["viewcells_over_gap"].as_u64(),
            Some(over as u64),
            "viewcells over the gap, in the report"
        );
        let line = format!("{over} of {} viewcells miss the gap of ", cells.len());
        assert_eq!(text(&baked.stdout).contains(&line), over > 0, "{}", text(&baked.stdout));
        (over, text(&baked.stdout))
    };
    assert_eq!(report(&["--gap", "100%"]).0, 0, "viewcells over a gap of 100 %");
    let (over, said) = report(&["--gap", "1%", "--time", "0"]);
    assert!(over > 0 && said.contains("the same command goes on"), "{said}");
}

#[test]
fn cameras_outside_all_viewcells_are_counted() {
    let folder = folder("bake_outside");
    write_wall(&folder.join("wall.vscn"), WHOLE);
    let inside = r#"{"eye": [0, -1, 1], "target": [0, 5, 1]}"#;
    let outside = r#"{"eye": [30, -1, 1], "target": [0, 5, 1]}"#;
    for (name, keys) in [("in.json", inside.to_owned()), ("both.json", format!("{inside}, {outside}"))] {
        let walks = format!(
            r#"{{"name": "w", "up_axis": "z", "near": 0.05, "cameras": [{{"name": "w", "fov_y_deg": 60,
            "up": [0, 0, 1], "keys": [{keys}]}}]}}"#
        );
        fs::write(folder.join(name), walks).unwrap();
    }
    for (cameras, line, is_outside) in [
        ("in.json", "1 of 1 cameras are inside viewcells\n", false),
        ("both.json", "1 of 2 cameras are inside viewcells; the others see everything", true),
    ] {
        let baked = bake_wall(&folder, "wall.set", &["--cameras", cameras, "--json", "report.json"]);
        assert!(text(&baked.stdout).contains(line), "{}{}", text(&baked.stdout), text(&baked.stderr));
        let report = fs::read_to_string(folder.join("report.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        assert_eq!(report["cameras_inside"].as_u64(), Some(1), "{cameras}: cameras inside, in the report");
        let arguments = ["wall.vscn", "--cameras", cameras, "--size", "64x36", "--cullers", "baked:wall.set"];
        let walk = run(env!("CARGO_BIN_EXE_walkthrough"), &folder, &arguments);
        assert!(walk.status.success(), "{cameras}: the walk succeeds");
        let said = text(&walk.stderr).contains("wall.set: 1 of 2 cameras are outside all viewcells");
        assert_eq!(said, is_outside, "{}", text(&walk.stderr));
    }
    // Without an argument for places, a single camera makes only a few viewcells.
    let still = |cells: &[&str]| {
        let arguments = ["wall.vscn", "--cameras", "in.json", "--gap", "100%", "--out", "still.set"];
        let baked = bake(&folder, &[&arguments[..], cells].concat());
        (text(&baked.stdout) + &text(&baked.stderr)).contains("--cells free adds all that can be reached")
    };
    assert!(
        still(&[]) && !still(&["--cells", "walks"]),
        "the hint at free cells, with and without a word on places"
    );
}

#[test]
fn a_name_that_would_be_two_cullers_is_told() {
    let folder = folder("bake_two_cullers");
    write_wall(&folder.join("wall.vscn"), WHOLE);
    for (name, expected) in
        [("a,b.pvs", "without , and +"), ("a+b.pvs", "without , and +"), ("a.pvs", "baked:a.pvs")]
    {
        let output = bake_wall(&folder, name, &[]);
        assert!(text(&output.stdout).contains(expected), "{name}: {}", text(&output.stdout));
    }
    fs::remove_dir_all(folder).unwrap();
}
