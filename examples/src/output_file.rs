//! Output files that are written completely or not at all, and locks for programs that work on a file for a
//! long time.

use std::fmt::Display;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Maximum number of links to follow, the same as in Linux.
const LINKS: usize = 40;

/// Writes a file completely or not at all, like [`write_with`].
///
/// # Errors
///
/// Returns a message with the path.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), String> {
    write_with(path, |out| out.write_all(bytes))
}

/// Writes a file completely or not at all. `fill` writes to a temporary file beside `path`, which then
/// replaces the file at `path` and takes over its permissions. On failure, the temporary file is removed and
/// the old file stays. If `path` is a link, its target is replaced. A device, pipe or socket is written
/// directly.
///
/// # Errors
///
/// Returns a message with the path.
pub fn write_with<E: Display + From<std::io::Error>>(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&File>) -> Result<(), E>,
) -> Result<(), String> {
    let told = |error: E| format!("cannot write {}: {error}", path.display());
    let fill = |file: &File| {
        let mut out = BufWriter::new(file);
        fill(&mut out)?;
        out.flush().map_err(E::from)
    };
    if is_special(path) {
        let opened = OpenOptions::new().write(true).open(path);
        return opened.map_err(E::from).and_then(|file| fill(&file)).map_err(told);
    }
    let path = target(path);
    let part = beside(&path, ".part");
    // A temporary `.part` file of a killed program is overwritten.
    let file = lock(&part, &path)?;
    let written = file.set_len(0).map_err(E::from).and_then(|()| fill(&file)).and_then(|()| {
        if let Ok(before) = std::fs::metadata(&path) {
            file.set_permissions(before.permissions())?;
        }
        file.sync_all()?;
        Ok(std::fs::rename(&part, &path)?)
    });
    if written.is_err() {
        // `file` is still open, and locked, so that no other program has begun to write the `.part` file. The
        // file may not exist, so the result is ignored.
        let _ = std::fs::remove_file(&part);
    }
    written.map_err(told)
}

/// Returns whether a path, or the target of a link at the path, exists and is neither a regular file nor a
/// folder.
pub fn is_special(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir())
}

/// Returns the target of a link at `path`, whether the target exists or not. `path` itself if it is no link.
pub fn target(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    for _ in 0..LINKS {
        let Ok(next) = std::fs::read_link(&path) else { break };
        path = path.parent().map_or(next.clone(), |folder| folder.join(next));
    }
    path
}

/// Returns a path with `end` appended to its file name.
pub fn beside(path: &Path, end: &str) -> PathBuf {
    let mut path = path.to_owned().into_os_string();
    path.push(end);
    PathBuf::from(path)
}

/// Lock of a file for as long as this value lives; released when it is dropped or the program ends in any
/// way. While the lock is held, there is an empty file with `.lock` appended to the name.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    _file: File,
}

impl Lock {
    /// Locks a file, which need not exist.
    ///
    /// # Errors
    ///
    /// Returns a message with the path if another program holds the lock, or if the `.lock` file cannot be
    /// created.
    pub fn new(path: &Path) -> Result<Self, String> {
        let beside = beside(path, ".lock");
        Ok(Self { _file: lock(&beside, path)?, path: beside })
    }
}

/// Opens and locks the file at `beside`, and creates it if necessary. The lock protects the file at `path`.
fn lock(beside: &Path, path: &Path) -> Result<File, String> {
    let told = |error: std::io::Error| format!("cannot write {}: {error}", beside.display());
    loop {
        let open = OpenOptions::new().create(true).truncate(false).write(true).open(beside);
        let file = open.map_err(told)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let path = path.display();
                return Err(format!(
                    "another program is at work on {path}: wait for it, or write to another file"
                ));
            }
            // A file system without locks: continue without one.
            Err(TryLockError::Error(error)) if has_no_locks(&error) => {}
            Err(TryLockError::Error(error)) => return Err(told(error)),
        }
        // The last holder of the lock may have removed or renamed the file meanwhile. Another program may
        // then lock a new file, so the lock of the old one is worthless.
        if is_at(&file, beside) {
            return Ok(file);
        }
    }
}

/// Returns whether an error of locking says that the file system has no locks.
fn has_no_locks(error: &std::io::Error) -> bool {
    /// ENOLCK of Linux, which has no [`ErrorKind`]: an NFS share whose server has no locks.
    const NO_LOCKS: i32 = 37;
    error.kind() == ErrorKind::Unsupported
        || cfg!(target_os = "linux") && error.raw_os_error() == Some(NO_LOCKS)
}

impl Drop for Lock {
    fn drop(&mut self) {
        // The file is removed before its lock is released. If it cannot be removed, the next program locks it
        // again.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Returns whether an open file is the same file as the one at a path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let (Ok(open), Ok(there)) = (file.metadata(), std::fs::metadata(path)) else { return false };
    (open.dev(), open.ino()) == (there.dev(), there.ino())
}

/// Returns whether there is any file at a path, since the standard library cannot tell here which file that
/// is. So if a program opens the file just before the holder of the lock removes it, and another program then
/// makes it anew, both programs hold a lock.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

/// Returns a name that is safe as part of a file name. Letters, digits and `-_.+` stay, and other characters,
/// such as path separators, become `_`.
pub fn plain_name(name: &str) -> String {
    let plain = |letter: char| if letter.is_alphanumeric() || "-_.+".contains(letter) { letter } else { '_' };
    name.chars().map(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates an empty folder for a test.
    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("visibility-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_replaced_whole_or_stays() {
        let folder = folder("whole");
        let file = folder.join("a.set");
        write(&file, b"first").unwrap();
        let failed = write_with(&file, |out| {
            out.write_all(&[7; 100_000])?;
            Err(std::io::Error::from(ErrorKind::StorageFull))
        });
        assert!(
            failed.unwrap_err().starts_with(&format!("cannot write {}: ", file.display())),
            "the error names the file"
        );
        assert_eq!(
            (std::fs::read(&file).unwrap(), names(&folder)),
            (b"first".to_vec(), vec!["a.set".to_owned()]),
            "a failed write leaves the file, and no other"
        );
        write(&file, b"second").unwrap();
        assert_eq!(
            (std::fs::read(&file).unwrap(), names(&folder).len()),
            (b"second".to_vec(), 1),
            "the file is replaced, and is alone"
        );
        assert!(
            write(&folder, b"").is_err() && write(&folder.join("none/a.set"), b"").is_err(),
            "a folder, and a file in a folder that does not exist"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_what_is_no_regular_file_stays() {
        use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
        let folder = folder("links");
        let file = folder.join("a.set");
        symlink("b.set", &file).unwrap();
        symlink(folder.join("c.set"), folder.join("b.set")).unwrap();
        write(&file, b"new").unwrap();
        let there = folder.join("c.set");
        std::fs::set_permissions(&there, PermissionsExt::from_mode(0o640)).unwrap();
        write(&file, b"newer").unwrap();
        assert_eq!(std::fs::read(&there).unwrap(), b"newer", "the file behind two links");
        assert_eq!(
            there.metadata().unwrap().permissions().mode() & 0o777,
            0o640,
            "the file keeps its permissions"
        );
        assert!(
            file.is_symlink() && folder.join("b.set").is_symlink() && !there.is_symlink(),
            "links stay links"
        );

        symlink("/dev/null", folder.join("null")).unwrap();
        write(&folder.join("null"), b"gone").unwrap();
        symlink("/dev/full", folder.join("full")).unwrap();
        assert!(
            !Path::new("/dev/full").exists() || write(&folder.join("full"), b"more").is_err(),
            "a full device is an error"
        );
        // A socket is created without extra libraries, and cannot be opened as a file.
        let socket = folder.join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        assert!(write(&socket, b"none").is_err(), "a socket cannot be written");
        assert!(socket.metadata().unwrap().file_type().is_socket(), "the socket stays");
        let dev_null = Path::new("/dev/null").metadata().unwrap().file_type();
        assert!(
            dev_null.is_char_device() && folder.join("null").is_symlink(),
            "the device and the link to it stay"
        );
        assert_eq!(
            names(&folder),
            ["a.set", "b.set", "c.set", "full", "null", "socket"],
            "files in the folder"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }

    // Elsewhere a file that was removed cannot be told from its successor.
    #[test]
    #[cfg(unix)]
    fn a_failed_write_removes_no_file_of_another_program() {
        let folder = folder("failed");
        let file = folder.join("a.set");
        let has_ended = std::sync::atomic::AtomicBool::new(false);
        let errors: Vec<String> = std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    while !has_ended.load(std::sync::atomic::Ordering::Relaxed) {
                        let _ = write_with(&file, |_| Err(std::io::Error::from(ErrorKind::StorageFull)));
                    }
                });
            }
            let errors = (0..1000).filter_map(|_| write(&file, b"whole").err()).collect();
            has_ended.store(true, std::sync::atomic::Ordering::Relaxed);
            errors
        });
        for error in errors {
            assert!(error.starts_with("another program is at work on "), "{error}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_file_system_without_locks_is_told_from_other_errors() {
        let error = std::io::Error::from;
        assert!(has_no_locks(&error(ErrorKind::Unsupported)), "a file system that knows no locks");
        assert!(!has_no_locks(&error(ErrorKind::PermissionDenied)), "a file that may not be locked");
        #[cfg(target_os = "linux")]
        assert!(has_no_locks(&std::io::Error::from_raw_os_error(37)), "ENOLCK of Linux");
    }

    #[test]
    fn one_program_at_a_time_works_on_a_file() {
        let folder = folder("lock");
        let file = folder.join("a.set");
        let lock = Lock::new(&file).unwrap();
        assert!(
            Lock::new(&file).unwrap_err().starts_with("another program is at work on "),
            "a second lock is refused"
        );
        assert!(Lock::new(&folder.join("b.set")).is_ok(), "a lock of another file");
        drop(lock);
        assert!(names(&folder).is_empty(), "a lock leaves no file");
        // A `.lock` file left by a killed program does not prevent locking.
        std::fs::write(beside(&file, ".lock"), b"").unwrap();
        drop(Lock::new(&file).unwrap());
        // Only one thread at a time holds the lock, even if many threads take and release it.
        let (held, taken) = (std::sync::atomic::AtomicUsize::new(0), std::sync::atomic::AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..500 {
                        let Ok(_lock) = Lock::new(&file) else { continue };
                        assert_eq!(
                            held.fetch_add(1, std::sync::atomic::Ordering::SeqCst),
                            0,
                            "two threads hold the lock"
                        );
                        taken.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
                        held.fetch_sub(1, std::sync::atomic::Ordering::SeqCst);
                    }
                });
            }
        });
        assert!(taken.into_inner() > 3, "the lock was taken");
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
