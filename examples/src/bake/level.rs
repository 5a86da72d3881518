//! The level of a bake: a scene in memory or in a file, its viewcells and the settings.

use super::degrees::Degrees;
use super::failure::Failure;
use super::job::Job;
use super::run::clock;
use super::viewcells::{self, Solids};
use crate::region::world;
use crate::source::{Bounds, Corners, check_hints};
use crate::walkthrough::World;
use crate::{SceneSource, SourceObject, open_by_object, ordinary_file};
use glam::{DVec3, Vec3};
use std::fmt;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;
use visibility_bake::{
    BakeCache, BakeSource, BakedSet, CellSandwich, LevelError, SandwichBaker, SandwichSettings, TiledScene,
    TiledSceneWriter,
};
use visibility_core::occlusion::Preparation;
use visibility_core::pvs::Viewcells;
use visibility_core::{Object, Scene};

/// Estimate of the memory in bytes that the program uses beside the level.
const PROGRAM_BYTES: u64 = 32 << 20;

/// The scene of a job with its viewcells.
pub struct Level {
    /// Name of the scene.
    pub name: String,
    /// All viewcells of the bake.
    pub viewcells: Viewcells,
    /// Up axis of the scene, a unit vector.
    pub up: Vec3,
    /// Eyes of all keys of the scene's walks.
    eyes: Vec<DVec3>,
    content: Content,
    settings: SandwichSettings,
    gap: f64,
    /// Results of an earlier bake, empty without one.
    cache: Arc<BakeCache>,
}

/// Storage of a level's triangles: memory or a file.
enum Content {
    /// The triangles are in memory.
    World(Box<World>),
    /// The triangles are in a file.
    File(Arc<TiledScene<'static>>),
}

impl Level {
    /// Loads the scene of a job and makes its viewcells. Gives up with an error once `stop` returns true.
    /// `scratch` is the path of the file for the triangles if the job limits the memory.
    ///
    /// # Errors
    ///
    /// [`Failure`] if the scene cannot be loaded, a hint matches no object, there are no viewcells or too
    /// many, or the memory or the time is too small.
    pub fn open(job: &Job, scratch: &Path, stop: fn() -> bool) -> Result<Self, Failure> {
        let settings =
            SandwichSettings::default().with_gap(job.gap).with_clearance(job.clearance).with_rays(job.rays);
        let (eyes, up);
        let (name, content, viewcells) = match job.memory {
            None => {
                let mut objects = Vec::new();
                let (source, bounds) = read(job, &mut |_, object| objects.push(object))?;
                let mut source = SceneSource { objects, ..source };
                job.cameras.give_whole(&mut source, &job.reading)?;
                viewcells::note_still_cameras(&mut source, &job.places);
                source.print_notes();
                let world = world(source);
                world.check_copies().map_err(|why| format!("{why}; --memory bounds what a bake keeps"))?;
                let solids = Solids::Scene(&world.scene);
                let viewcells =
                    viewcells::make(&job.places, &job.reading, &world.source, bounds, &solids, stop)?;
                (eyes, up) = (eyes_of(&world.source), world.source.up);
                (world.source.name.clone(), Content::World(Box::new(world)), viewcells)
            }
            Some(memory) => {
                // The scene's origin is only known once the first object is read, so the writer is made then.
                let (mut writer, mut failed) = (None, None);
                let (mut source, bounds) = read(job, &mut |origin, object| {
                    if failed.is_some() {
                        return;
                    }
                    let append = |writer: &mut Option<TiledSceneWriter>| {
                        let writer = match writer {
                            Some(writer) => writer,
                            none => none.insert(TiledScene::writer(scratch, origin)?),
                        };
                        append(writer, object)
                    };
                    failed = append(&mut writer).err();
                })?;
                if let Some(failed) = failed {
                    return Err(failed.into());
                }
                // The first reading had no error. Walks are made in a second reading of the objects, so that
                // only one object at a time is in memory.
                job.cameras.give(&mut source, &job.reading, |each| {
                    let _ = open_by_object(&job.scene, &job.reading, &mut |_, mut object| {
                        object.take_all(&job.hints, &mut vec![false; job.hints.len()]);
                        each(&object);
                    });
                })?;
                viewcells::note_still_cameras(&mut source, &job.places);
                source.print_notes();
                let writer = writer.map_or_else(|| TiledScene::writer(scratch, source.origin), Ok)?;
                let (level, places) = (writer.finish(memory, PROGRAM_BYTES)?, &job.places);
                let viewcells =
                    viewcells::make(places, &job.reading, &source, bounds, &Solids::Level(&level), stop)?;
                (eyes, up) = (eyes_of(&source), source.up);
                (source.name, Content::File(Arc::new(level)), viewcells)
            }
        };
        let viewcells = Viewcells::new(viewcells);
        Ok(Self { name, viewcells, up, eyes, content, settings, gap: job.gap, cache: Arc::default() })
    }

    /// Reuses the results in a cache file that an earlier bake has written. Does nothing if there is no such
    /// file.
    ///
    /// # Errors
    ///
    /// Returns a message if the file cannot be read or is damaged.
    pub fn take_cache(&mut self, path: &Path) -> Result<(), String> {
        let named = |error: &dyn fmt::Display| format!("{}: {error}", path.display());
        match ordinary_file::read(path) {
            Ok(bytes) => {
                self.cache = Arc::new(
                    BakeCache::from_bytes(&bytes)
                        .map_err(|error| named(&format!("{error}; remove the file to begin anew")))?,
                );
                Ok(())
            }
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            Err(error) => Err(named(&error)),
        }
    }

    /// Prepares the bake of all viewcells.
    pub fn baker(&self) -> SandwichBaker<'_> {
        let baker = match &self.content {
            Content::World(world) => SandwichBaker::new(&world.scene, &self.viewcells, self.settings),
            Content::File(level) => SandwichBaker::of_level(level.clone(), &self.viewcells, self.settings),
        };
        baker.with_clock(clock).with_cache(self.cache.clone())
    }

    /// Returns two numbers: all cameras (keys of all walks), and the cameras inside a viewcell.
    pub fn cameras(&self) -> [usize; 2] {
        let inside = self.eyes.iter().filter(|&&eye| self.viewcells.locate(eye).is_some()).count();
        [self.eyes.len(), inside]
    }

    /// Returns the gap that the job allows: the share of the reported triangles neither seen nor proven
    /// hidden.
    pub fn gap(&self) -> f64 {
        self.gap
    }

    /// Returns the fingerprint of the bake, which is the same for all its shards.
    pub fn fingerprint(&self) -> u64 {
        self.baker().whole_fingerprint()
    }

    /// Makes the set of viewcells and visible objects that a game loads, with degrees of visibility unless
    /// `degrees` asks for none. `cells` are the results of a bake, and `source` is what was baked.
    ///
    /// # Errors
    ///
    /// Returns a message if the sets are too large to be stored, or not of this level, if degrees are asked
    /// for and the level is in a file, or if there is no memory for the pictures of the samples.
    pub fn set(
        &self,
        source: BakeSource,
        cells: &[CellSandwich],
        degrees: &Degrees,
    ) -> Result<BakedSet, String> {
        let viewcells = self.viewcells.clone();
        let set = match &self.content {
            Content::World(world) => BakedSet::new(&world.scene, viewcells, source, cells),
            Content::File(level) => BakedSet::of_level(level, viewcells, source, cells),
        };
        let set = set.map_err(|error| error.to_string())?;
        let Some(eyes) = degrees.eyes() else { return Ok(set) };
        let Content::World(world) = &self.content else {
            return Err("--degrees samples a scene in memory, without --memory".to_owned());
        };
        let sampled = degrees.sample(&world.scene, &self.viewcells, cells, eyes)?;
        set.with_degrees(&sampled, eyes).map_err(|error| error.to_string())
    }

    /// Returns the scene with its triangles and walks. `None` if the level is in a file.
    pub fn world(&self) -> Option<&World> {
        match &self.content {
            Content::World(world) => Some(world),
            Content::File(_) => None,
        }
    }

    /// Returns the number of objects. Their indices start at 0.
    pub fn object_count(&self) -> usize {
        match &self.content {
            Content::World(world) => world.scene.len(),
            Content::File(level) => level.object_count(),
        }
    }

    /// Returns the number of triangles of the object at an index. `None` if there is no such object.
    pub fn cost(&self, index: u32) -> Option<u32> {
        match &self.content {
            Content::World(world) => {
                world.scene.object(world.scene.id_at(index as usize)?).ok().map(|object| object.cost)
            }
            Content::File(level) => level.cost(index),
        }
    }
}

/// Makes the scene of a job. Passes each object, with the job's hints applied, to `each` together with the
/// scene's origin. Returns the scene without objects, and the bounds of all objects relative to the origin,
/// `None` without objects.
///
/// # Errors
///
/// Returns a message if the scene cannot be made or read, or a hint matches no object.
fn read(
    job: &Job,
    each: &mut dyn FnMut(DVec3, SourceObject),
) -> Result<(SceneSource, Option<Corners>), String> {
    let mut bounds = Bounds::default();
    let mut is_named = vec![false; job.hints.len()];
    let source = open_by_object(&job.scene, &job.reading, &mut |origin, mut object| {
        object.take_all(&job.hints, &mut is_named);
        bounds.add(&object);
        each(origin, object);
    });
    let source = source.map_err(|error| error.to_string())?;
    check_hints(&job.hints, &is_named)?;
    Ok((source, bounds.corners()))
}

/// Returns the eyes of all keys of a scene's walks.
fn eyes_of(source: &SceneSource) -> Vec<DVec3> {
    source.walks.iter().flat_map(|walk| &walk.keys).map(|key| key.eye).collect()
}

/// Appends an object to a level in a file, with its occluder mesh.
fn append(writer: &mut TiledSceneWriter, object: SourceObject) -> Result<(), LevelError> {
    let mut scene = Scene::new();
    let whole = object.object();
    let id = scene.insert(Object { occluder: whole.occluder && !object.door, ..whole });
    scene.set_triangles(id, object.fixed_triangles()).expect("the object was just inserted");
    scene.prepare_occluders(&Preparation::default().with_two_sided(true));
    let (Ok(object), Ok(triangles)) = (scene.object(id), scene.triangles(id)) else { return Ok(()) };
    writer.push(&object, triangles, scene.occluder(id))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::{Run, run};
    use glam::DAffine3;
    use std::time::Duration;
    use visibility_core::pvs::Viewcell;
    use visibility_core::scene::SharedTriangles;

    #[derive(clap::Parser)]
    struct Only {
        #[command(flatten)]
        job: Job,
    }

    impl Level {
        /// Opens a small level with eight viewcells, for tests of what is done with a bake.
        pub(in crate::bake) fn of_eight_viewcells() -> Self {
            let arguments = "bake london:1,1 --size 16,16,4 --over 0,0,0,64,32,4 --gap 100% --rays 20";
            let Only { job } = clap::Parser::parse_from(arguments.split(' '));
            Self::open(&job, Path::new(""), || false).unwrap()
        }

        /// Returns a level with one viewcell of 2 m along x, and a wall across it at x = 1.1 m. On each side
        /// of the wall are 300 copies of a mesh of 2^12 triangles: a search may copy those of one side, and
        /// not those of both.
        pub(in crate::bake) fn of_copies() -> Self {
            let strip = |i: usize| {
                let corner = |x: usize, z: f32| Vec3::new(x as f32 * 1e-4, 0.0, z);
                [corner(i, 0.0), corner(i + 1, 0.0), corner(i, 1.0)]
            };
            let mesh = SharedTriangles::from((0..1 << 12).map(strip).collect::<Vec<_>>());
            let corner = |y: f32, z: f32| Vec3::new(1.1, y, z);
            let [a, b, c, d] =
                [corner(-90.0, -90.0), corner(90.0, -90.0), corner(90.0, 90.0), corner(-90.0, 90.0)];
            let mut objects = vec![SourceObject::new("wall", vec![[a, b, c], [a, c, d]])];
            for i in 0..600 {
                let x = if i % 2 == 0 { -4.0 } else { 6.0 };
                let at = DVec3::new(x, f64::from(i / 2 % 20), f64::from(i / 40));
                let triangles = mesh.placed(DAffine3::from_translation(at));
                objects.push(SourceObject { opaque: false, ..SourceObject::new("copy", triangles) });
            }
            let world = world(SceneSource { objects, ..SceneSource::new("copies", Vec3::Z, 0.01) });
            Self {
                name: "copies".to_owned(),
                viewcells: Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.0))]),
                up: Vec3::Z,
                eyes: Vec::new(),
                content: Content::World(Box::new(world)),
                settings: SandwichSettings::default().with_gap(1.0).with_rays(1),
                gap: 1.0,
                cache: Arc::default(),
            }
        }
    }

    #[test]
    fn hints_change_what_they_name_or_are_refused() {
        let open = |hint: &str| {
            let Only { job } = clap::Parser::try_parse_from(["", "london:2,2", "--hint", hint]).ok()?;
            Level::open(&job, Path::new(""), || false).ok()
        };
        let level = open("mover=b1").unwrap();
        let scene = &level.world().unwrap().scene;
        let of = |flag: fn(&visibility_core::Object) -> bool| {
            scene.ids().filter(|&id| flag(&scene.object(id).unwrap())).count()
        };
        let movers = of(|object| object.never_cull);
        assert!(0 < movers && movers < scene.len(), "{movers}");
        assert!(of(|object| object.occluder) <= scene.len() - movers, "movers are no occluders");
        for wrong in ["mover=house", "moover=b1", "mover"] {
            assert!(open(wrong).is_none(), "{wrong}");
        }
        let scratch = std::env::temp_dir().join(format!("bake-hints-{}", std::process::id()));
        let refused = |hints: &[&str]| {
            let arguments = ["", "london:2,2", "--memory", "64M"].iter().chain(hints);
            let Only { job } = clap::Parser::parse_from(arguments);
            let error = Level::open(&job, &scratch, || false).err();
            assert!(
                error.is_none() || !scratch.exists(),
                "{hints:?}: no scratch file is left after an error"
            );
            error.map(|error| error.to_string())
        };
        assert_eq!(refused(&["--hint", "mover=b1"]), None, "a hint with a known name");
        let error = refused(&["--hint", "door=b1", "--hint", "mover=house", "--hint", "mover=tree"]);
        assert_eq!(
            error.as_deref(),
            Some("no name of an object contains `house`"),
            "the hint whose name is unknown"
        );
    }

    #[test]
    fn a_level_in_a_file_has_the_same_result() {
        for scene in ["london:2,2", "office:1,3"] {
            let bytes = |memory: &[&str]| {
                let arguments = ["", scene, "--gap", "100%", "--rays", "4"];
                let hints = ["--hint", "door=b1", "--hint", "never-cull=b2"];
                let arguments = arguments.iter().chain(if scene == "london:2,2" { &hints[..] } else { &[] });
                let Only { job } = clap::Parser::parse_from(arguments.chain(memory));
                let path =
                    |end: &str| std::env::temp_dir().join(format!("bake-level-{}.{end}", std::process::id()));
                let level = Level::open(&job, &path("scratch"), || false).unwrap();
                let save_every = Duration::from_secs(60);
                let settings = Run { threads: 1, limit: None, save_every, state: path("state") };
                let outcome = run(|| level.baker(), &settings, |_| {}).unwrap();
                assert!(outcome.complete && outcome.error.is_none(), "{scene}: the bake is complete");
                (
                    level.fingerprint(),
                    level.set(outcome.source, &outcome.cells, &Degrees::default()).unwrap().to_bytes(),
                )
            };
            assert!(bytes(&[]) == bytes(&["--memory", "256M"]), "{scene}");
        }
        let Only { job } = clap::Parser::parse_from(["", "london:2,2", "--memory", "32M"]);
        let scratch = std::env::temp_dir().join(format!("bake-few-{}", std::process::id()));
        assert!(
            matches!(Level::open(&job, &scratch, || false), Err(Failure::Memory(_))),
            "too little memory"
        );
        assert!(!scratch.exists(), "no scratch file is left");
    }
}
