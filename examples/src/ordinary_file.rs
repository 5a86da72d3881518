//! Reading of files whose paths a user or a file names. Folders, pipes and devices are refused.

use std::fs::File;
use std::io::{Error, Read, Result};
use std::path::Path;

/// Opens a file for reading.
///
/// # Errors
///
/// Returns the error of the file system, or an error that says so if the path is a folder, a pipe or a
/// device. A pipe without a writer would be waited for, and some devices never end.
pub fn open(path: &Path) -> Result<File> {
    if std::fs::metadata(path)?.is_file() {
        return File::open(path);
    }
    Err(Error::other("it is no ordinary file, but a folder, a pipe or a device"))
}

/// Reads all bytes of a file.
///
/// # Errors
///
/// Returns the errors of [`open`], and those of reading.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[cfg(all(test, unix))]
mod tests {
    use crate::walkthrough::World;
    use crate::{built_in, floor_plans, level_occluders, load, load_walks, pvs, region, visc};
    use std::fmt::Display;
    use std::path::Path;

    #[test]
    fn no_reader_reads_a_device() {
        fn message<T>(read: Result<T, impl Display>) -> String {
            read.err().map_or_else(|| "it was read".into(), |error| error.to_string())
        }
        let device = Path::new("/dev/null");
        let world = World::new(built_in("office:1,2").unwrap(), (64, 36), Some(1)).unwrap();
        let links = ["glb", "vscn"].map(|extension| {
            let link = std::env::temp_dir().join(format!("device-{}.{extension}", std::process::id()));
            let _ = std::fs::remove_file(&link);
            std::os::unix::fs::symlink(device, &link).unwrap();
            link
        });
        let read = [
            message(floor_plans::load(device)),
            message(level_occluders::read(device, &world)),
            message(load_walks(device)),
            message(pvs::read(device)),
            message(region::read_sets(device, &world)),
            message(visc::scene_file::load(device)),
            message(visc::visibility_file::load(device)),
            message(load(&links[0])),
            message(load(&links[1])),
        ];
        for (number, message) in read.iter().enumerate() {
            assert!(message.contains("it is no ordinary file"), "reader {number}: {message}");
        }
        links.iter().for_each(|link| std::fs::remove_file(link).unwrap());
    }
}
