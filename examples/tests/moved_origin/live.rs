//! Cullers together with the data they are made from, which are synced with the scene from time to time.

use glam::DVec3;
use std::sync::Arc;
use visibility_2d::horizon::{Horizon, HorizonCuller, HorizonOccluders, UpAxis};
use visibility_2d::view_cdt::ViewCdt;
use visibility_bsp::{
    LargeOccludersCuller, NaylorCuller, Occluders, OcclusionTree, OcclusionTreeCuller, SceneTree,
    ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::occlusion::{HardwareQueries, LateAnswers, Occlusion, QueryDevice};
use visibility_core::{Aabb, Culler, OccluderMesh, OcclusionCuller, OcclusionMap, Scene, View, VisibleSet};
use visibility_frame::backface::BackfaceCuller;
use visibility_hzb::{Hom, Hzb, HzbCuller};
use visibility_plp::{Budget, ConservativePlpCuller, DelaunayTessellation, OctreeTessellation};
use visibility_testing::PlainMap;

/// Culler that can be synced with a scene.
pub(crate) trait Live {
    fn name(&self) -> &str;
    /// Greatest distance in metres of eyes from the scene's origin along each axis.
    fn reach(&self) -> f64 {
        12.0
    }
    fn culler(&mut self) -> &mut dyn Culler;
    fn sync(&mut self, scene: &Scene);
}

struct Following<C, F> {
    name: &'static str,
    culler: C,
    follow: F,
}

impl<C: Culler, F: FnMut(&mut C, &Scene)> Live for Following<C, F> {
    fn name(&self) -> &str {
        self.name
    }

    fn culler(&mut self) -> &mut dyn Culler {
        &mut self.culler
    }

    fn sync(&mut self, scene: &Scene) {
        (self.follow)(&mut self.culler, scene);
    }
}

fn live<C: Culler + 'static>(
    name: &'static str,
    culler: C,
    follow: impl FnMut(&mut C, &Scene) + 'static,
) -> Box<dyn Live> {
    Box::new(Following { name, culler, follow })
}

fn map<M: OcclusionMap + 'static>(name: &'static str, map: M) -> Box<dyn Live> {
    live(name, OcclusionCuller::new(map), |_, _| {})
}

/// Simulated query device whose answers arrive one frame late, and hold for the picture in which they were
/// asked.
pub(crate) struct LateDevice {
    map: PlainMap,
    asked: Vec<(u64, bool)>,
}

impl LateDevice {
    pub(crate) fn new() -> Self {
        Self { map: PlainMap::new(24, 16), asked: Vec::new() }
    }
}

impl QueryDevice for LateDevice {
    fn ask(&mut self, query: u64, boxes: &[Aabb]) {
        let passed = boxes.iter().any(|bounds| self.map.test(bounds) != Occlusion::Hidden);
        self.asked.push((query, passed));
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, u32)) {
        self.asked.drain(..).for_each(|(query, passed)| each(query, u32::from(passed)));
    }

    fn draw(&mut self, occluder: &OccluderMesh, transform: &glam::Affine3A) {
        self.map.add(occluder, transform);
        self.map.flush();
    }
}

/// Culler with hardware queries, which passes the view to its device as an engine would.
pub(crate) struct Queries(pub(crate) HardwareQueries<LateDevice>);

impl OcclusionMap for Queries {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn accuracy(&self) -> visibility_core::Accuracy {
        self.0.accuracy()
    }

    fn answers_at_once(&self) -> bool {
        false
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.0.device_mut().map.begin(view, origin);
        self.0.begin(view, origin);
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &glam::Affine3A) {
        self.0.add(occluder, transform);
    }

    fn flush(&mut self) {
        self.0.flush();
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        self.0.test(bounds)
    }

    fn test_mut(&mut self, bounds: &Aabb) -> Occlusion {
        self.0.test_mut(bounds)
    }

    fn test_64_mut(
        &mut self,
        boxes: &visibility_core::scene::Boxes64,
        candidates: u64,
    ) -> visibility_core::occlusion::Occlusion64 {
        self.0.test_64_mut(boxes, candidates)
    }

    fn scene_changed(&mut self) {
        self.0.scene_changed();
    }

    fn candidates_changed(&mut self) {
        self.0.candidates_changed();
    }

    fn reset(&mut self) {
        self.0.reset();
    }
}

/// Culls each view twice, like a camera at rest, since late answers only count in the second frame.
struct Twice<C>(C);

impl<C: Culler> Culler for Twice<C> {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn accuracy(&self) -> visibility_core::Accuracy {
        self.0.accuracy()
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> visibility_core::CullStats {
        for _ in 0..2 {
            self.0.cull(scene, view, &mut visible.clone());
        }
        self.0.cull(scene, view, visible)
    }
}

pub(crate) const ALL: &[fn() -> Box<dyn Live>] = &[
    || live("backface", BackfaceCuller::new(), BackfaceCuller::sync),
    || live("hzb", HzbCuller::new(Hzb::new(256, 160).unwrap()), |_, _| {}),
    || map("hom", Hom::new(256, 160).unwrap()),
    || map("view-cdt", ViewCdt::new()),
    || map("horizon as a map", Horizon::new(UpAxis::Z)),
    || map("occlusion-tree map", OcclusionTree::new()),
    || {
        let queries = Queries(HardwareQueries::new(LateDevice::new(), LateAnswers::Visible));
        live("hardware queries", Twice(OcclusionCuller::new(queries)), |_, _| {})
    },
    || {
        let mut occluders = HorizonOccluders::new(&Scene::new(), UpAxis::Z);
        live("horizon", HorizonCuller::new(occluders.clone().into()), move |culler, scene| {
            occluders.sync(scene);
            culler.set_occluders(occluders.clone().into());
        })
    },
    || {
        let mut occluders = Occluders::default();
        live("occlusion-tree", OcclusionTreeCuller::new(Arc::default()), move |culler, scene| {
            occluders.sync(scene);
            culler.set_occluders(occluders.clone().into());
        })
    },
    || {
        let mut occluders = Occluders::default();
        live("large-occluders", LargeOccludersCuller::new(Arc::default()), move |culler, scene| {
            occluders.sync(scene);
            culler.set_occluders(occluders.clone().into());
        })
    },
    || {
        let none = Scene::new();
        let none = ShadowFrusta::new(&none, Occluders::new(&none), 1, 1);
        live("shadow-frusta", ShadowFrustaCuller::new(none.into()), |culler, scene| {
            culler.set_frusta(ShadowFrusta::new(scene, Occluders::new(scene), 4, 16).into());
        })
    },
    || {
        let tree = Arc::new(SceneTree::new(&Scene::new()).unwrap());
        live("naylor", NaylorCuller::new(tree), |culler, scene| {
            Arc::make_mut(culler.shared_mut()).sync(scene).unwrap();
        })
    },
    || {
        let cells = Arc::new(OctreeTessellation::new(&Scene::new()));
        let plp = ConservativePlpCuller::new(cells, Budget::Objects(10), Hzb::new(256, 160).unwrap());
        live("cplp", plp, |culler, scene| {
            if !Arc::make_mut(culler.shared_mut()).sync(scene) {
                Arc::make_mut(culler.shared_mut()).rebuild(scene);
            }
        })
    },
    || {
        let cells = Arc::new(DelaunayTessellation::new(&Scene::new()));
        let plp = ConservativePlpCuller::new(cells, Budget::Objects(10), Hzb::new(256, 160).unwrap());
        live("cplp with tetrahedra", plp, |culler, scene| {
            if !Arc::make_mut(culler.shared_mut()).sync(scene) {
                Arc::make_mut(culler.shared_mut()).rebuild(scene);
            }
        })
    },
];
