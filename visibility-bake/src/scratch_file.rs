//! A file with the triangles and occluder meshes of a level, in the order of the objects. As many tiles are
//! kept in memory as a limit allows.
//!
//! Only the process that has written the file reads it. The process knows where each object begins and the
//! hash of the object's content, and removes the file at the end. For each object the file has, as
//! little-endian words: the number of triangles, the numbers of the mesh's positions and triangles, 1 if the
//! mesh is two-sided, and, if there is a mesh, the twelve numbers of its transform. Then follow nine words
//! for each triangle, three for each position, and three for each triangle of the mesh.
//!
//! Working threads share the memory. A thread that requests more than is free waits until others release
//! some. If all others are waiting too, none would ever release any, so the last thread to request memory
//! gets an error instead. It releases what it has, and starts again when no other thread works
//! ([`LevelFile::work`]).

use crate::level_error::LevelError;
use crate::object_facts::ObjectFacts;
use crate::tile_tree::TileTree;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::{
    Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard, TryLockError,
};
use visibility_core::glam::{Affine3A, Vec3};
use visibility_core::scene::{Triangle, Triangles};
use visibility_core::{Object, OccluderMesh};

/// Number of words at the beginning of an object's content, before the transform or the triangles.
const HEAD_WORDS: usize = 4;

/// Number of words of a transform.
const TRANSFORM_WORDS: usize = 12;

/// Estimated memory in bytes of a loaded tile per unit of weight (triangles plus 4 per object): for a
/// triangle and its part of the occluder mesh.
const BYTES_PER_WEIGHT: u64 = 300;

/// Estimated memory in bytes that an object takes while the level is open: for its properties, the offset of
/// its content, and its tile.
const OBJECT_BYTES: u64 = 100;

/// Content of an object: its triangles, and its occluder mesh with the transform to level coordinates.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Content {
    pub triangles: Box<[Triangle]>,
    pub mesh: Option<(OccluderMesh, Affine3A)>,
}

/// A file that is removed when this value is dropped.
struct ScratchFile {
    path: PathBuf,
    file: File,
}

impl Drop for ScratchFile {
    fn drop(&mut self) {
        // A file that cannot be removed stays.
        let _ = std::fs::remove_file(&self.path);
    }
}

impl ScratchFile {
    fn error(&self, error: &std::io::Error) -> LevelError {
        LevelError::File { path: self.path.clone(), kind: error.kind() }
    }
}

/// Writes the content of objects to a scratch file, one object after another.
pub(crate) struct ContentWriter {
    scratch: ScratchFile,
    to: BufWriter<File>,
    /// Offset in bytes of each object's content, by the object's number, then the end of the last.
    offsets: Vec<u64>,
    /// Scratch memory for the bytes of one object's content.
    bytes: Vec<u8>,
}

impl ContentWriter {
    /// Creates the file. An existing regular file is replaced; anything else at the path is an error.
    pub(crate) fn create(path: PathBuf) -> Result<Self, LevelError> {
        if path.symlink_metadata().is_ok_and(|found| found.is_file()) {
            // If a file cannot be removed, creating it fails below.
            let _ = std::fs::remove_file(&path);
        }
        let file = File::options().read(true).write(true).create_new(true).open(&path);
        let file = file.map_err(|error| LevelError::File { path: path.clone(), kind: error.kind() })?;
        let scratch = ScratchFile { path, file };
        let to = BufWriter::new(scratch.file.try_clone().map_err(|error| scratch.error(&error))?);
        Ok(Self { scratch, to, offsets: vec![0], bytes: Vec::new() })
    }

    /// Appends the content of an object: its triangles, and its occluder mesh with the transform to level
    /// coordinates. The mesh is `None` for an object without one.
    pub(crate) fn push(
        &mut self,
        triangles: Triangles<'_>,
        mesh: Option<(&OccluderMesh, Affine3A)>,
    ) -> Result<(), LevelError> {
        self.bytes.clear();
        let (positions, faces) =
            mesh.map_or((&[][..], &[][..]), |(mesh, _)| (mesh.positions(), mesh.triangles()));
        let two_sided = mesh.is_some_and(|(mesh, _)| mesh.is_two_sided());
        let head = [triangles.len() as u32, positions.len() as u32, faces.len() as u32, two_sided.into()];
        let transform = mesh.map(|(_, transform)| transform.to_cols_array());
        let corners = triangles.iter().flatten();
        let points = corners.chain(positions.iter().copied()).flat_map(|p| p.to_array());
        let words = head.into_iter();
        let words = words.chain(transform.into_iter().flatten().chain(points).map(f32::to_bits));
        let words = words.chain(faces.as_flattened().iter().copied());
        self.bytes.extend(words.flat_map(u32::to_le_bytes));
        self.to.write_all(&self.bytes).map_err(|error| self.scratch.error(&error))?;
        let end = self.offsets.last().copied().unwrap_or_default() + self.bytes.len() as u64;
        self.offsets.push(end);
        Ok(())
    }

    /// Completes the file. `limit` is the memory in bytes that the whole process may use, `in_use` the part
    /// of it that is used already.
    pub(crate) fn finish(
        mut self,
        objects: &[ObjectFacts],
        tree: &TileTree,
        limit: u64,
        in_use: u64,
    ) -> Result<LevelFile, LevelError> {
        self.to.flush().map_err(|error| self.scratch.error(&error))?;
        let mut tile_of = vec![0; objects.len()];
        for tile in 0..tree.tiles.len() as u32 {
            tree.own(tile).iter().for_each(|&at| tile_of[at as usize] = tile);
        }
        let fixed = in_use.saturating_add(OBJECT_BYTES * objects.len() as u64);
        let memory = Memory {
            limit,
            reserved: fixed,
            cached: 0,
            requests: 0,
            tiles: HashMap::new(),
            by_request: BTreeMap::new(),
            running: 0,
        };
        let file = LevelFile {
            scratch: Mutex::new(self.scratch),
            offsets: self.offsets,
            tile_of,
            shared: Arc::new(Shared { memory: Mutex::new(memory), changed: Condvar::new() }),
            turn: RwLock::new(()),
        };
        file.reserve(0)?;
        Ok(file)
    }
}

/// The file with the content of a level, and those of its tiles that are in memory.
pub(crate) struct LevelFile {
    scratch: Mutex<ScratchFile>,
    /// Offset in bytes of each object's content, by the object's number, then the end of the last.
    offsets: Vec<u64>,
    /// Number of the tile of each object, by number of the object.
    tile_of: Vec<u32>,
    shared: Arc<Shared>,
    /// Lock that a thread holds while it works on the level: a read lock for work beside other threads, the
    /// write lock for work that needs all the memory.
    turn: RwLock<()>,
}

/// The memory that threads and their [reservations](Reserved) share.
struct Shared {
    memory: Mutex<Memory>,
    /// Notified when memory is released, and when a thread ends or suspends its work.
    changed: Condvar,
}

/// State of the memory for a level in a file. All sizes are estimates in bytes.
struct Memory {
    /// Upper limit of the sum of `reserved` and `cached`.
    limit: u64,
    /// Bytes that releasing tiles cannot free: those of [reservations](Reserved), and those that are always
    /// in use.
    reserved: u64,
    /// Bytes of the tiles that are kept in memory.
    cached: u64,
    /// Number of requests for tiles so far.
    requests: u64,
    /// Tiles that are loaded, by their numbers.
    tiles: HashMap<u32, LoadedTile>,
    /// The tile of each [`LoadedTile::last_request`] in `tiles`, the least recently used first.
    by_request: BTreeMap<u64, u32>,
    /// Number of threads that are working, without those that wait for memory.
    running: usize,
}

/// The content of a tile, held in memory.
struct LoadedTile {
    content: Arc<[Content]>,
    bytes: u64,
    /// Value of [`Memory::requests`] at the last request for the tile.
    last_request: u64,
}

impl Memory {
    /// Releases tiles, least recently used first, until `bytes` are free. Returns false if `bytes` would not
    /// be free even without any tile.
    fn make_room(&mut self, bytes: u64) -> bool {
        let reserved = self.reserved.saturating_add(bytes);
        if reserved > self.limit {
            return false;
        }
        while reserved.saturating_add(self.cached) > self.limit {
            let oldest = self.by_request.pop_first();
            let Some(tile) = oldest.and_then(|(_, tile)| self.tiles.remove(&tile)) else { return false };
            self.cached -= tile.bytes;
        }
        true
    }

    /// Counts a request for a tile. Returns its number, and the tile's content if the tile is in memory.
    fn request(&mut self, tile: u32) -> (u64, Option<Arc<[Content]>>) {
        self.requests += 1;
        let content = self.tiles.get_mut(&tile).map(|loaded| {
            self.by_request.remove(&std::mem::replace(&mut loaded.last_request, self.requests));
            self.by_request.insert(self.requests, tile);
            loaded.content.clone()
        });
        (self.requests, content)
    }

    /// Keeps a tile in memory if there is room for it.
    fn keep(&mut self, tile: u32, loaded: LoadedTile) {
        let (bytes, request) = (loaded.bytes, loaded.last_request);
        if self.make_room(bytes) {
            self.by_request.insert(request, tile);
            match self.tiles.insert(tile, loaded) {
                // Another thread has read the tile too.
                Some(former) => drop(self.by_request.remove(&former.last_request)),
                None => self.cached += bytes,
            }
        }
    }
}

/// A reservation of memory, which ends when it is dropped.
pub(crate) struct Reserved {
    shared: Arc<Shared>,
    bytes: u64,
}

impl Drop for Reserved {
    fn drop(&mut self) {
        lock(&self.shared.memory).reserved -= self.bytes;
        self.shared.changed.notify_all();
    }
}

/// A thread's right to work on the level, which ends when it is dropped.
pub(crate) struct Working<'a> {
    file: &'a LevelFile,
    _turn: Turn<'a>,
}

/// The lock that a thread holds while it works: shared with other threads or exclusive.
enum Turn<'a> {
    Together { _guard: RwLockReadGuard<'a, ()> },
    Alone { _guard: RwLockWriteGuard<'a, ()> },
}

impl Drop for Working<'_> {
    fn drop(&mut self) {
        lock(&self.file.shared.memory).running -= 1;
        self.file.shared.changed.notify_all();
    }
}

/// Locks a mutex, also if a thread has panicked while it held the lock.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl LevelFile {
    /// Begins a thread's work on the level. With `is_alone`, waits until all other threads have ended their
    /// work, and keeps others from beginning. A thread must not call this again until its work has ended.
    pub(crate) fn work(&self, is_alone: bool) -> Working<'_> {
        let _turn = if is_alone {
            Turn::Alone { _guard: self.turn.write().unwrap_or_else(PoisonError::into_inner) }
        } else {
            Turn::Together { _guard: self.turn.read().unwrap_or_else(PoisonError::into_inner) }
        };
        lock(&self.shared.memory).running += 1;
        Working { file: self, _turn }
    }

    /// Locks a mutex that another thread may hold while it waits for memory. While the calling thread waits,
    /// it does not count as working. Only for threads that have called [`work`](Self::work).
    pub(crate) fn lock<'m, T>(&self, mutex: &'m Mutex<T>) -> MutexGuard<'m, T> {
        match mutex.try_lock() {
            Ok(guard) => guard,
            Err(TryLockError::Poisoned(error)) => error.into_inner(),
            Err(TryLockError::WouldBlock) => {
                lock(&self.shared.memory).running -= 1;
                self.shared.changed.notify_all();
                let guard = lock(mutex);
                lock(&self.shared.memory).running += 1;
                guard
            }
        }
    }

    /// Reserves memory, and waits while there is not enough of it. The waiting ends with
    /// [`LevelError::Memory`] once all other working threads are waiting too, since none of them can then
    /// release memory.
    pub(crate) fn reserve(&self, bytes: u64) -> Result<Reserved, LevelError> {
        let mut memory = lock(&self.shared.memory);
        while !memory.make_room(bytes) {
            if memory.running <= 1 {
                let needed = memory.reserved.saturating_add(bytes);
                return Err(LevelError::Memory { limit: memory.limit, needed });
            }
            memory.running -= 1;
            memory = self.shared.changed.wait(memory).unwrap_or_else(PoisonError::into_inner);
            memory.running += 1;
        }
        memory.reserved += bytes;
        Ok(Reserved { shared: self.shared.clone(), bytes })
    }

    /// Calls `each` for some objects, in the order of `numbers`, with the object's position in that list and
    /// its content.
    pub(crate) fn for_each(
        &self,
        objects: &[ObjectFacts],
        tree: &TileTree,
        numbers: &[u32],
        mut each: impl FnMut(usize, &Content),
    ) -> Result<(), LevelError> {
        let mut loaded: Option<(u32, Arc<[Content]>)> = None;
        for (place, &at) in numbers.iter().enumerate() {
            let tile = self.tile_of[at as usize];
            let content = match loaded.take() {
                Some((of, content)) if of == tile => content,
                _ => self.tile(objects, tree, tile)?,
            };
            // Numbers are in ascending order within a tile.
            if let Ok(own) = tree.own(tile).binary_search(&at) {
                each(place, &content[own]);
            }
            loaded = Some((tile, content));
        }
        Ok(())
    }

    /// Returns the content of a tile's objects. Reads it from the file unless it is in memory.
    fn tile(
        &self,
        objects: &[ObjectFacts],
        tree: &TileTree,
        tile: u32,
    ) -> Result<Arc<[Content]>, LevelError> {
        let (last_request, content) = lock(&self.shared.memory).request(tile);
        if let Some(content) = content {
            return Ok(content);
        }
        let bytes = BYTES_PER_WEIGHT * tree.tiles[tile as usize].weight;
        // While the tile is read it takes memory, whether or not it is kept afterwards.
        let reserved = self.reserve(bytes)?;
        let content =
            tree.own(tile).iter().map(|&at| self.read(&objects[at as usize], at)).collect::<Result<_, _>>();
        let content: Arc<[Content]> = content?;
        drop(reserved);
        let loaded = LoadedTile { content: content.clone(), bytes, last_request };
        lock(&self.shared.memory).keep(tile, loaded);
        Ok(content)
    }

    /// Reads the content of an object from the file, and compares its hash with that of the content written.
    fn read(&self, facts: &ObjectFacts, at: u32) -> Result<Content, LevelError> {
        let (offset, end) = (self.offsets[at as usize], self.offsets[at as usize + 1]);
        let mut bytes = vec![0; (end - offset) as usize];
        let read = {
            let mut file = &lock(&self.scratch).file;
            file.seek(SeekFrom::Start(offset)).and_then(|_| file.read_exact(&mut bytes))
        };
        let damaged = || {
            let path = lock(&self.scratch).path.clone();
            LevelError::Content { path, object: facts.index, offset }
        };
        match read {
            Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => return Err(damaged()),
            Err(error) => return Err(lock(&self.scratch).error(&error)),
            Ok(()) => {}
        }
        let content = parse(&bytes).ok_or_else(damaged)?;
        let mesh = content.mesh.as_ref().map(|(mesh, transform)| (mesh, *transform));
        let found = ObjectFacts::new(facts.index, &facts.object(), content.triangles[..].into(), mesh);
        if found.hash == facts.hash { Ok(content) } else { Err(damaged()) }
    }
}

/// Parses the content of an object. `None` if the number of bytes does not match the announced counts, or if
/// the mesh is invalid.
fn parse(bytes: &[u8]) -> Option<Content> {
    let mut words = bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let mut next = || words.next();
    let [triangles, positions, faces, two_sided] = [next()?, next()?, next()?, next()?].map(|n| n as usize);
    let head = HEAD_WORDS + if faces > 0 { TRANSFORM_WORDS } else { 0 };
    // The counts are checked against the length before memory is allocated for them.
    let sizes = [(triangles, 9), (positions, 3), (faces, 3)];
    let expected = sizes.iter().try_fold(head, |sum, (n, each)| n.checked_mul(*each)?.checked_add(sum))?;
    if expected.checked_mul(4)? != bytes.len() {
        return None;
    }
    let mut transform = [0.0; TRANSFORM_WORDS];
    if faces > 0 {
        for x in &mut transform {
            *x = f32::from_bits(next()?);
        }
    }
    let mut point =
        || Some(Vec3::new(f32::from_bits(next()?), f32::from_bits(next()?), f32::from_bits(next()?)));
    let triangle = |_| Some([point()?, point()?, point()?]);
    let triangles: Box<[Triangle]> = (0..triangles).map(triangle).collect::<Option<_>>()?;
    let positions: Vec<Vec3> = (0..positions).map(|_| point()).collect::<Option<_>>()?;
    let mut corners = Vec::with_capacity(faces);
    for _ in 0..faces {
        corners.push([words.next()?, words.next()?, words.next()?]);
    }
    let mesh = if faces > 0 {
        let mesh = OccluderMesh::from_indexed(&positions, &corners).ok()?;
        Some((mesh.with_two_sided(two_sided != 0), Affine3A::from_cols_array(&transform)))
    } else {
        None
    };
    Some(Content { triangles, mesh })
}

/// Returns the properties of an object with its triangles and mesh.
///
/// # Errors
/// [`LevelError::TooMany`] if the index is not below `u32::MAX`, or there are more triangles than 32 bits
/// count.
pub(crate) fn facts(
    index: usize,
    object: &Object,
    triangles: Triangles<'_>,
    mesh: Option<(&OccluderMesh, Affine3A)>,
) -> Result<ObjectFacts, LevelError> {
    let index = u32::try_from(index).ok().filter(|&index| index < u32::MAX).ok_or(LevelError::TooMany)?;
    u32::try_from(triangles.len()).map_err(|_| LevelError::TooMany)?;
    Ok(ObjectFacts::new(index, object, triangles, mesh))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
    use visibility_core::Aabb;

    #[test]
    fn tiles_are_given_up_and_read_again_within_the_limit() {
        let path = std::env::temp_dir().join(format!("visibility-tiles-{}", std::process::id()));
        let mut writer = ContentWriter::create(path.clone()).unwrap();
        let corner = |at: usize| Vec3::new((at * 37 % 200) as f32, (at * 53 % 190) as f32, 0.0);
        let triangles = |at: usize| -> Vec<Triangle> {
            let low = corner(at);
            let high = low + Vec3::Z * (at as f32 / 600.0);
            (0..at % 5).map(|k| [high, low + Vec3::X * (k as f32 * 0.25), low + Vec3::Y]).collect()
        };
        let known = |at: usize| {
            let low = corner(at);
            let object = Object::new(Aabb::new(low, low + 1.0));
            facts(at, &object, triangles(at)[..].into(), None).unwrap()
        };
        let objects: Vec<ObjectFacts> = (0..600).map(known).collect();
        (0..600).for_each(|at| writer.push(triangles(at)[..].into(), None).unwrap());
        let tree = TileTree::with_leaves(&objects, 0, 100);
        let fixed = OBJECT_BYTES * 600;
        let file = writer.finish(&objects, &tree, fixed + 300 * BYTES_PER_WEIGHT, 0).unwrap();
        let in_tiles = tree.order.clone();
        let scattered: Vec<u32> = (0..600).map(|at| at * 7 % 600).collect();
        let (mut loads, mut kept) = (0, 0);
        for numbers in [&in_tiles, &scattered, &in_tiles] {
            let mut places = 0;
            file.for_each(&objects, &tree, numbers, |place, content| {
                assert_eq!(place, places, "object {place} comes in its turn");
                assert_eq!(
                    content.triangles[..],
                    triangles(numbers[place] as usize)[..],
                    "triangles of object {place}"
                );
                places += 1;
                let memory = lock(&file.shared.memory);
                assert!(
                    memory.reserved + memory.cached <= memory.limit,
                    "object {place}: {} bytes of {}",
                    memory.reserved + memory.cached,
                    memory.limit
                );
                let sizes: u64 = memory.tiles.values().map(|tile| tile.bytes).sum();
                assert_eq!(sizes, memory.cached, "object {place}: bytes of all tiles");
                let requests: BTreeMap<u64, u32> =
                    memory.tiles.iter().map(|(&number, tile)| (tile.last_request, number)).collect();
                assert_eq!(requests, memory.by_request, "object {place}: tiles by their last requests");
                (loads, kept) = (memory.requests, kept.max(memory.tiles.len()));
            })
            .unwrap();
            assert_eq!(places, 600, "objects passed");
        }
        assert!(loads > 600 && kept > 1, "{loads} times a tile, of which {kept} were kept at once");
        // All memory that is not always in use can be reserved. Then no tile is left in memory. Reserved
        // memory becomes free again.
        let all = file.reserve(300 * BYTES_PER_WEIGHT).unwrap();
        assert!(lock(&file.shared.memory).tiles.is_empty(), "tiles are left though all memory is reserved");
        assert!(matches!(file.reserve(1), Err(LevelError::Memory { .. })), "one byte more than the limit");
        drop(all);
        assert!(file.reserve(300 * BYTES_PER_WEIGHT).is_ok(), "the memory came back");
        drop(file);
        assert!(!path.exists(), "the file is removed with the level");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_is_replaced_and_a_link_is_refused() {
        let path = std::env::temp_dir().join(format!("visibility-replaced-{}", std::process::id()));
        let behind = path.with_extension("behind");
        let _ = std::fs::remove_file(&behind);
        std::os::unix::fs::symlink(&behind, &path).unwrap();
        let refused = ContentWriter::create(path.clone()).err();
        assert!(matches!(refused, Some(LevelError::File { .. })), "a link: {refused:?}");
        assert!(path.is_symlink() && !behind.exists(), "the link stays, and no file is made behind it");
        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, b"left by a killed bake").unwrap();
        // Another name of the same file keeps its content.
        std::fs::hard_link(&path, &behind).unwrap();
        drop(ContentWriter::create(path.clone()).unwrap());
        assert!(!path.exists(), "the file is removed with its writer");
        assert_eq!(std::fs::read(&behind).unwrap(), b"left by a killed bake", "the file that was replaced");
        std::fs::remove_file(&behind).unwrap();
    }

    #[test]
    fn the_tile_requested_longest_ago_is_released_first() {
        let file = empty("order", 100);
        let mut memory = lock(&file.shared.memory);
        // Two threads read tile 7 at once.
        let requests = [7, 7, 8].map(|tile| (tile, memory.request(tile)));
        for (tile, (last_request, content)) in requests {
            assert!(content.is_none(), "tile {tile} is not in memory yet");
            memory.keep(tile, LoadedTile { content: Arc::new([]), bytes: 30, last_request });
        }
        assert!(memory.request(7).1.is_some(), "tile 7 is in memory");
        for tile in [9, 10] {
            let (last_request, _) = memory.request(tile);
            memory.keep(tile, LoadedTile { content: Arc::new([]), bytes: 30, last_request });
        }
        let kept: Vec<u32> = memory.by_request.values().copied().collect();
        assert_eq!((kept, memory.cached), (vec![7, 9, 10], 90), "tile 7 was requested again after tile 8");
    }

    /// Returns a level without objects, with the given number of bytes of memory for threads.
    fn empty(name: &str, bytes: u64) -> LevelFile {
        let path = std::env::temp_dir().join(format!("visibility-{name}-{}", std::process::id()));
        let tree = TileTree::new(&[]);
        ContentWriter::create(path).unwrap().finish(&[], &tree, bytes, 0).unwrap()
    }

    #[test]
    fn threads_wait_for_memory_and_no_two_wait_for_one_another() {
        let file = empty("wait", 100);
        let (in_use, given_up, shared) = (Mutex::new(0), Mutex::new(0), Mutex::new(()));
        // Each thread needs nearly all the memory, in two parts. Every second thread also holds a mutex
        // meanwhile.
        let attempt = |file: &LevelFile, number: u64| {
            let _shared = number.is_multiple_of(2).then(|| file.lock(&shared));
            let first = file.reserve(40 + number)?;
            std::thread::yield_now();
            let second = file.reserve(45)?;
            *lock(&in_use) += first.bytes + second.bytes;
            assert!(*lock(&in_use) <= 100, "number {number}: more memory is in use than there is");
            std::thread::yield_now();
            *lock(&in_use) -= first.bytes + second.bytes;
            Ok::<(), LevelError>(())
        };
        std::thread::scope(|scope| {
            for number in 0..6 {
                let (file, attempt, given_up) = (&file, &attempt, &given_up);
                scope.spawn(move || {
                    for _ in 0..300 {
                        let together = {
                            let _working = file.work(false);
                            attempt(file, number)
                        };
                        if together.is_err() {
                            *lock(given_up) += 1;
                            let _working = file.work(true);
                            assert_eq!(attempt(file, number), Ok(()), "nobody else has any memory");
                        }
                    }
                });
            }
        });
        assert!(*lock(&given_up) < 1800, "none has waited");
        let memory = lock(&file.shared.memory);
        assert_eq!((memory.reserved, memory.running), (0, 0), "memory and threads left in the end");
    }

    #[test]
    fn memory_that_another_thread_releases_is_waited_for() {
        let file = empty("release", 100);
        let _working = file.work(false);
        let all = file.reserve(100).unwrap();
        let has_begun = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| {
                let _working = file.work(false);
                has_begun.store(true, Relaxed);
                file.reserve(100).map(|_| ())
            });
            let runs = || lock(&file.shared.memory).running > 1 || !has_begun.load(Relaxed);
            while runs() && !waiting.is_finished() {
                std::thread::yield_now();
            }
            assert!(!waiting.is_finished(), "the thread got memory that was not released");
            drop(all);
            assert_eq!(waiting.join().unwrap(), Ok(()), "the thread got its memory");
        });
        let _all = file.reserve(100).unwrap();
        assert!(file.reserve(1).is_err(), "nobody else could release any");
    }
}
