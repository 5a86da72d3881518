//! Serialisation by `serde`: what is written is read as the same value, in a format of text and in one of
//! bytes, and what no constructor makes is refused.

use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;
use visibility_culling::bake::{SandwichSettings, ViewcellBudget};
use visibility_culling::cells::{CellId, PortalId};
use visibility_culling::exact::{Effort, ExactSettings};
use visibility_culling::geometry::{Plane, Sphere};
use visibility_culling::glam::{Affine3A, DVec3, Vec3};
use visibility_culling::hzb::Coverage;
use visibility_culling::measure::DrawCost;
use visibility_culling::occluders::LevelSettings;
use visibility_culling::occlusion::Preparation;
use visibility_culling::pipeline::Explanation;
use visibility_culling::plp::{Budget, Fineness, Solidity};
use visibility_culling::portals::from_geometry::WallSettings;
use visibility_culling::portals::{BakerSettings, ChainTest, Narrowing};
use visibility_culling::pvs::{Viewcell, ViewcellId};
use visibility_culling::scene::{DrawRange, MeshId, SceneError};
use visibility_culling::two_d::cdt::{Opacity, Plan, PlanView, Wall, WallHit};
use visibility_culling::two_d::discs::Disc;
use visibility_culling::two_d::horizon::UpAxis;
use visibility_culling::two_d::viewshed::Observer;
use visibility_culling::two_d::virtual_occluders::VirtualOccluder;
use visibility_culling::view::{Depth, Reach, Window};
use visibility_culling::{
    Aabb, FrustumCuller, Object, ObjectId, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet,
};

/// Asserts that a value is read as it was written, from text and from bytes.
fn round_trips<T: Serialize + DeserializeOwned + PartialEq + Debug>(value: T) {
    let text = serde_json::to_string(&value).expect("a valid value is written as text");
    let read: T = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
    assert_eq!(read, value, "read from {text}");
    let bytes = postcard::to_allocvec(&value).expect("a valid value is written as bytes");
    let read: T = postcard::from_bytes(&bytes).unwrap_or_else(|error| panic!("{value:?}: {error}"));
    assert_eq!(read, value, "read from bytes");
}

/// Asserts that some text is refused as a `T` with a message that contains `reason`.
fn refuses<T: DeserializeOwned + Debug>(text: &str, reason: &str) {
    let error = serde_json::from_str::<T>(text).expect_err(text).to_string();
    assert!(error.contains(reason), "{text} is refused because of {reason}, not: {error}");
}

/// Asserts that the bytes of `parts`, which hold the fields of a `T`, are refused as a `T`.
fn refuses_bytes<T: DeserializeOwned + Debug>(parts: impl Serialize, case: &str) {
    let bytes = postcard::to_allocvec(&parts).expect("numbers are written");
    assert!(postcard::from_bytes::<T>(&bytes).is_err(), "{case} is refused");
}

fn pose() -> Pose {
    Pose::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(9.0, 4.0, 3.5), DVec3::Z)
}

fn view() -> View {
    View::perspective(pose(), 1.0, 1.5, 0.1, f64::INFINITY).expect("a camera")
}

#[test]
fn values_are_read_as_written() {
    let bounds = Aabb::from_arrays([0.1, -2.0, 3.0], [0.2, 5.0, f32::MAX]);
    let plane = Plane::new(DVec3::new(0.1, 0.2, 0.3), -4.0);
    let mut scene = Scene::new();
    let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3])).expect("a cuboid");
    round_trips((scene.insert(bounds), scene.add_mesh(mesh), ObjectId::PLACEHOLDER));
    round_trips((CellId(3), PortalId(u32::MAX), ViewcellId(0)));
    round_trips((bounds, Sphere::new(Vec3::new(1.0, 2.0, 3.0), 0.5), plane));
    round_trips(Viewcell { min: DVec3::ZERO, max: DVec3::ONE, planes: vec![plane, plane.flipped()] });
    round_trips(Object {
        layers: 6,
        cost: 7,
        never_cull: false,
        occluder: true,
        see_through: false,
        one_sided: true,
        ..Object::new(bounds)
    });
    round_trips([DrawRange::ALWAYS, DrawRange { begin: 1.0, end: 9.0, margin: 0.5 }]);
    round_trips((pose(), Window { left: -1.0, right: 2.0, bottom: -3.0, top: 4.0 }, Reach::new(0.25, 0.125)));
    round_trips([
        Depth::NegativeOneToOne,
        Depth::NegativeOneToOneInfinite,
        Depth::ZeroToOne,
        Depth::ZeroToOneInfinite,
        Depth::Reversed,
        Depth::ReversedInfinite,
    ]);
    round_trips(view());
    let far = DVec3::new(1e7, -2e7, 3.0);
    let clipped = view().relative_to(far).and_then(|view| view.with_clip_planes(&[plane, plane.flipped()]));
    round_trips(clipped.expect("a view with two clip planes").with_layers(5));
}

#[test]
fn settings_are_read_as_written() {
    round_trips(Preparation::default().with_sliver(0.5).with_min_area(0.25).with_two_sided(true));
    round_trips([Coverage::Conservative, Coverage::Sampled]);
    let level = LevelSettings::default().with_flatness(0.5).with_bulge(0.25);
    round_trips(level.with_kept_area(0.125).with_max_cluster_edges(7));
    round_trips((Budget::Objects(3), Budget::Cost(4), Fineness { vertices: 5, halvings: 6 }));
    round_trips([Solidity::Coverage, Solidity::Count]);
    let baker = BakerSettings::default();
    round_trips([baker, baker.with_clearance(0.5).with_steps_per_cell(9).with_depth(8)]);
    round_trips(baker.with_chain_test(ChainTest::Pluecker));
    round_trips([Narrowing::Polygon, Narrowing::Rectangle]);
    let walls = WallSettings::default().with_tolerance(0.5).with_min_share(0.25);
    round_trips(walls.with_min_area(0.75).with_margin(3.0).with_max_cells(99));
    round_trips([Effort::Rays(9), Effort::Share(0.5), Effort::Exact(0.25)]);
    let efforts = [Effort::Rays(9), Effort::Share(0.5), Effort::Exact(0.25)];
    round_trips(efforts.map(|effort| ExactSettings::new(effort).with_kept_proofs()));
    round_trips(SandwichSettings::default().with_gap(0.5).with_clearance(0.25).with_rays(6));
    round_trips(ViewcellBudget::new(7, DVec3::new(1.0, 2.0, 3.0)).with_agreement(0.5));
    round_trips(DrawCost { object_us: 0.5, triangle_us: 0.25 });
}

#[test]
fn what_stands_on_plans_is_read_as_written() {
    let wall = Wall::new([0.1, -2.0], [3.0, 4e59]);
    round_trips([
        wall,
        wall.with_opacity(Opacity::OneWay).with_heights(-1.5, 2.5),
        wall.with_opacity(Opacity::Clear),
    ]);
    round_trips([wall.with_heights(f64::NEG_INFINITY, 2.5), wall.with_heights(0.5, f64::INFINITY)]);
    let view = PlanView::new([0.5, 0.25]);
    round_trips([
        view,
        view.with_range(9.0).with_sector([1.0, 0.0], [0.0, 1.0]).with_heights(1.7, 0.0).with_through(2),
    ]);
    round_trips([Disc { center: [1.0, -2.0], radius: 0.5 }, Disc { center: [1e150, 0.0], radius: 0.0 }]);
    let observer = Observer::new(1.5, 2.0);
    round_trips([observer, observer.with_height(1.8).with_target_height(30.0).with_max_distance(5e3)]);
    round_trips(observer.with_curvature(6.7e-8));
    round_trips(VirtualOccluder { up: UpAxis::Y, ends: [[1.0, 2.0], [3.0, 4.0]], bottom: -1.0, top: 9.0 });
    // The walls of a plan, and an answer on it, as a program would keep them.
    let plan = Plan::new(&[Wall::new([0.0, 0.0], [1.0, 0.0]), wall]).expect("a plan");
    round_trips(plan.walls().to_vec());
    let hit: Option<WallHit> = plan.ray([0.5, 1.0], [0.5, 0.5]).expect("a ray");
    assert_eq!(hit.expect("a hit").wall, Some(0), "the first wall stops the ray");
    round_trips(hit);
    let written = serde_json::to_string(&Wall::new([0.0, 1.0], [2.0, 3.0])).expect("a wall is written");
    let expected = r#"{"ends":[[0.0,1.0],[2.0,3.0]],"opacity":"Opaque","low":null,"high":null}"#;
    assert_eq!(written, expected, "the text of a wall");
    let short = r#"{"ends":[[0,1],[2,3]],"opacity":"Opaque"}"#;
    let read: Wall = serde_json::from_str(short).expect("a wall without heights");
    assert_eq!(read, Wall::new([0.0, 1.0], [2.0, 3.0]), "a wall without heights has all");
}

#[test]
fn what_no_plan_takes_is_refused() {
    refuses::<Wall>(r#"{"ends":[[0,1],[2,1e61]],"opacity":"Opaque"}"#, "no number up to 1e60");
    refuses::<Wall>(r#"{"ends":[[0,1],[2,3]],"opacity":"Thick"}"#, "unknown variant `Thick`");
    let point = [0.0f64, 0.0];
    for (case, heights) in [("a NaN", [f64::NAN, 1.0]), ("no range", [f64::INFINITY, f64::INFINITY])] {
        let error = serde_json::to_string(&Wall::new(point, [1.0, 0.0]).with_heights(heights[0], heights[1]));
        assert!(error.is_err(), "a wall with heights of {case} is not written");
    }
    let none: Option<f64> = None;
    refuses_bytes::<Wall>(([[f64::NAN, 0.0], point], 0u8, none, none), "a wall with a NaN");
    refuses_bytes::<Wall>(([point, point], 0u8, none, Some(f64::NAN)), "a wall whose top is NaN");
    refuses::<PlanView>(r#"{"eye":[0,1e61],"through":0}"#, "no number up to 1e60");
    refuses::<PlanView>(r#"{"eye":[0,1],"sector":[[0,1],[1e61,0]],"through":0}"#, "no number up to 1e60");
    refuses::<PlanView>(r#"{"eye":[0,1],"range":-1,"through":0}"#, "a range or height that is none");
    let infinite = PlanView::new(point).with_heights(f64::INFINITY, 0.0);
    assert!(serde_json::to_string(&infinite).is_err(), "a view with an infinite height is not written");
    refuses::<WallHit>(r#"{"point":[-1e61,0],"wall":null}"#, "no number up to 1e60");
    refuses::<Disc>(r#"{"center":[0,0],"radius":-1}"#, "no radius");
    refuses::<Disc>(r#"{"center":[0,1e151],"radius":1}"#, "beyond 1e150");
    refuses::<Observer>(
        r#"{"row":0,"column":0,"height":-1,"target_height":0,"curvature":0}"#,
        "height, distance or curvature is out of range",
    );
    refuses_bytes::<Observer>((f64::NAN, 0.0, 0.0, 0.0, none, 0.0), "an observer at NaN");
    refuses::<VirtualOccluder>(r#"{"up":"Z","ends":[[0,0],[1,0]],"bottom":2,"top":1}"#, "above its top");
}

#[test]
fn text_has_the_names_of_the_fields() {
    let object = Object::new(Aabb::from_arrays([0.0; 3], [1.0, 2.0, 3.0]));
    let written = serde_json::to_string(&object).expect("an object is written");
    let expected = concat!(
        r#"{"bounds":{"min":[0.0,0.0,0.0],"max":[1.0,2.0,3.0]},"layers":4294967295,"cost":1,"#,
        r#""never_cull":false,"occluder":false,"see_through":false,"one_sided":false}"#
    );
    assert_eq!(written, expected, "the text of an object");
    let ids = (CellId(3), ObjectId::PLACEHOLDER, Depth::Reversed, DrawRange::ALWAYS);
    let written = serde_json::to_string(&ids).expect("ids are written");
    let expected =
        r#"[3,{"index":4294967295,"generation":0},"Reversed",{"begin":0.0,"end":null,"margin":0.0}]"#;
    assert_eq!(written, expected, "the text of ids");
}

#[test]
fn settings_that_are_left_out_have_their_defaults() {
    let read: SandwichSettings = serde_json::from_str(r#"{"gap":0.5}"#).expect("one setting");
    assert_eq!(read, SandwichSettings::default().with_gap(0.5), "a gap alone");
    let read: BakerSettings = serde_json::from_str("{}").expect("no setting");
    assert_eq!(read, BakerSettings::default(), "no settings");
    refuses::<SandwichSettings>(r#"{"gab":0.5}"#, "unknown field `gab`");
    refuses::<Window>(r#"{"left":0.0}"#, "missing field `right`");
}

#[test]
fn improper_boxes_are_refused() {
    let reason = "a box has a NaN, or a minimum above its maximum";
    for axis in 0..3 {
        let (mut low, mut high) = ([0.0f32; 3], [1.0f32; 3]);
        (low[axis], high[axis]) = (high[axis], low[axis]);
        refuses::<Aabb>(&format!(r#"{{"min":{low:?},"max":{high:?}}}"#), reason);
        let inverted = Aabb::from_arrays(low, high);
        let error = serde_json::to_string(&inverted).expect_err("an inverted box is not written");
        assert!(error.to_string().contains(reason), "an inverted box is refused when written: {error}");
        low = [0.0; 3];
        low[axis] = f32::NAN;
        refuses_bytes::<Aabb>((low, [1.0f32; 3]), "a box with a NaN as its minimum");
        refuses_bytes::<Aabb>(([0.0f32; 3], low), "a box with a NaN as its maximum");
        refuses_bytes::<Object>((low, [1.0f32; 3], 1u32, 1u32, [false; 4]), "an object with such a box");
    }
    refuses::<Object>(r#"{"bounds":{"min":[2,0,0],"max":[1,1,1]},"layers":1,"cost":1}"#, reason);
    refuses::<Sphere>(r#"{"center":[0,0,0],"radius":-1}"#, "a negative radius");
    refuses::<Viewcell>(r#"{"min":[0,0,0],"max":[1,-1,1],"planes":[]}"#, "a minimum above its maximum");
    refuses::<Plane>(r#"{"normal":[0,0,0],"offset":1}"#, "no direction");
}

#[test]
fn views_pass_the_checks_of_their_constructors() {
    let text = serde_json::to_string(&view().with_clip_planes(&[Plane::new(DVec3::X, 1.0)]).expect("a view"));
    let valid: serde_json::Value = serde_json::from_str(&text.expect("a view is written")).expect("JSON");
    let changed = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut value = valid.clone();
        change(&mut value);
        value.to_string()
    };
    serde_json::from_str::<View>(&changed(&|_| ())).expect("the view as it was");
    let zero = serde_json::json!([0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    refuses::<View>(&changed(&|view| view["clip_from_local"] = zero.clone()), "singular");
    let skewed = serde_json::json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    refuses::<View>(&changed(&|view| view["clip_from_local"] = skewed.clone()), "of no camera");
    let many = serde_json::Value::from(vec![valid["clip_planes"][0].clone(); 99]);
    refuses::<View>(&changed(&|view| view["clip_planes"] = many.clone()), "99 clip planes");
    refuses::<View>(&changed(&|view| view["depth"] = "Backwards".into()), "unknown variant");
    let mut matrix = view().clip_from(view().origin()).to_cols_array();
    matrix[5] = f64::NAN;
    let no_planes: [(); 0] = [];
    refuses_bytes::<View>((matrix, [0.0f64; 3], 4u8, 1u32, no_planes.as_slice()), "a matrix with a NaN");
    matrix[5] = 1.0;
    let origin = [0.0, f64::INFINITY, 0.0];
    refuses_bytes::<View>((matrix, origin, 4u8, 1u32, no_planes.as_slice()), "an origin that is not finite");
    refuses::<Window>(r#"{"left":1,"right":0,"bottom":0,"top":1}"#, "a window is empty");
    refuses_bytes::<Pose>(([f64::NAN; 3], [0.0f64; 3], [0.0f64; 3], [0.0f64; 3]), "a pose of NaN");
    refuses::<DrawRange>(r#"{"begin":2,"end":1,"margin":0}"#, "not a range");
    refuses::<DrawRange>(r#"{"begin":-1,"end":null,"margin":0}"#, "not a range");
}

#[test]
fn settings_pass_the_checks_of_their_setters() {
    let read: Reach = serde_json::from_str(r#"{"metres":-1,"radians":2}"#).expect("a reach");
    assert_eq!(read, Reach::new(-1.0, 2.0), "a negative reach counts as 0");
    let read: LevelSettings = serde_json::from_str(r#"{"bulge":-3,"kept_area":7}"#).expect("settings");
    assert_eq!(read, LevelSettings::default().with_bulge(0.0).with_kept_area(1.0), "settings out of range");
    let exact = ExactSettings::new(Effort::Share(0.5));
    let text = serde_json::to_string(&exact).expect("settings are written");
    let negative = text.replace("0.0001", "-1.0");
    let read: ExactSettings = serde_json::from_str(&negative).expect("settings");
    assert_eq!(read, exact.with_clearance(0.0), "a negative clearance counts as 0: {negative}");
    refuses::<ExactSettings>(&text.replace("0.5", "-0.5"), "visible share");
    refuses::<ExactSettings>(&text.replace("true", "false"), "visible share");
    refuses_bytes::<DrawCost>((f64::NAN, 0.0f64), "a drawing cost that is NaN");
}

#[test]
fn forged_ids_are_unknown_to_a_scene() {
    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([5.0, -1.0, -1.0], [6.0, 1.0, 1.0]);
    let id = scene.insert(bounds);
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).expect("a cuboid"));
    let mut pipeline = Pipeline::new().with(FrustumCuller::new());
    pipeline.set_explaining(true);
    let mut visible = VisibleSet::new();
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).expect("a camera");
    pipeline.cull(&scene, &view, &mut visible);
    let known = serde_json::to_string(&id).expect("an id is written");
    let read: ObjectId = serde_json::from_str(&known).expect("the id");
    assert_eq!(scene.object(read).map(|object| object.bounds), Ok(bounds), "the object of the id as written");
    assert!(visible.contains(&scene, read), "the object of the id as written is visible");
    let other = id.generation().wrapping_add(1);
    for (index, generation) in [(0, other), (0, 0), (1, id.generation()), (u32::MAX, id.generation())] {
        let text = format!(r#"{{"index":{index},"generation":{generation}}}"#);
        let forged: ObjectId = serde_json::from_str(&text).expect("an id of any numbers");
        assert_eq!(scene.object(forged), Err(SceneError::UnknownObject(forged)), "object {text}");
        assert_eq!(
            scene.set_bounds(forged, bounds),
            Err(SceneError::UnknownObject(forged)),
            "bounds of {text}"
        );
        assert!(scene.remove(forged).is_err(), "removal of {text}");
        assert!(!visible.contains(&scene, forged), "visibility of {text}");
        assert_eq!(pipeline.explain(forged), Explanation::Unknown, "explanation of {text}");
    }
    let forged: MeshId = serde_json::from_str(r#"{"index":0,"generation":0}"#).expect("an id");
    let error = Err(SceneError::UnknownMesh(forged));
    assert_eq!(scene.set_mesh(id, forged, Affine3A::IDENTITY), error, "a forged mesh");
    let known = serde_json::to_string(&mesh).expect("an id is written");
    let read: MeshId = serde_json::from_str(&known).expect("the id");
    assert_eq!(scene.set_mesh(id, read, Affine3A::IDENTITY), Ok(()), "the mesh of the id as written");
}
