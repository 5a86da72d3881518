// Tests of the package: what it exports, what its calls answer, and how they fail. Each runs with both
// modules.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import test from "node:test";
import {
  ALL_LAYERS,
  Depth,
  Flag,
  NO_OBJECT,
  Opacity,
  VisibilityError,
  hasSimd128,
  indexOf,
  load,
} from "../package/visibility.js";

const WALL = { min: [4, -9, -9], max: [5, 9, 9] };
const LAMP = { min: [7, -1, -1], max: [8, 1, 1] };
const CAMERA = { eye: [0, 0, 0], target: [1, 0, 0], up: [0, 0, 1], fovY: 1, aspect: 1.5, near: 0.1 };
/** The same camera's matrix: reversed depth, no far plane. Column-major. */
const SCALE = 1 / Math.tan(0.5);
const MATRIX = [0, 0, 0, 1, -SCALE / 1.5, 0, 0, 0, 0, SCALE, 0, 0, 0, 0, 0.1, 0];

const refused = (code, message) => (error) => {
  assert.ok(error instanceof VisibilityError, `${error}`);
  assert.equal(error.code, code);
  assert.match(error.message, message);
  return true;
};

for (const simd128 of [false, true]) {
  const say = (what) => `${simd128 ? "simd128" : "plain"}: ${what}`;
  const visibility = await load({ simd128 });
  const foreign = (await load({ simd128 })).createScene();

  /** A wall that hides a lamp. */
  const street = () => {
    const scene = visibility.createScene();
    const [wall, lamp] = scene.insertAll({
      bounds: [WALL, LAMP].flatMap(({ min, max }) => [...min, ...max]),
    });
    scene.setFlags(wall, Flag.Occluder);
    scene.setMesh(wall, scene.addBoxMesh(WALL));
    const view = visibility.createView();
    view.setPerspective(CAMERA);
    return { scene, wall, lamp, view, visible: visibility.createVisible({ changes: true }) };
  };

  test(say("a wall hides a lamp until it opens"), () => {
    const { scene, wall, lamp, view, visible } = street();
    const pipeline = visibility.createPipeline().addFrustum().addZBuffer();
    assert.equal(pipeline.accuracy, "conservative");
    pipeline.setExplaining(true);
    assert.equal(pipeline.cull(scene, view, visible).visible, 1);
    assert.deepEqual([...visible.indices], [indexOf(wall)]);
    assert.deepEqual([...visible.ids], [wall]);
    assert.deepEqual([...visible.bits], [1]);
    assert.equal(pipeline.explain(lamp), "removed by hzb");
    assert.equal(pipeline.stageStats(1).occluders, 1);
    assert.ok(visible.contains(scene, wall) && !visible.contains(scene, lamp));

    scene.setFlags(wall, 0);
    pipeline.cull(scene, view, visible);
    visible.sortByIndex(scene);
    assert.deepEqual([...visible.indices], [0, 1]);
    assert.deepEqual([...visible.newlyVisible], [lamp]);
    assert.deepEqual([...visible.newlyHidden], []);
  });

  test(say("matrices of both precisions, and parallel cameras"), () => {
    const { scene, wall, lamp, view, visible } = street();
    const pipeline = visibility.createPipeline().addFrustum().addZBuffer();
    for (const matrix of [MATRIX, new Float32Array(MATRIX), new Float64Array(MATRIX)]) {
      view.setMatrix(matrix, Depth.ReversedInfinite);
      pipeline.cull(scene, view, visible);
      assert.deepEqual([...visible.ids], [wall]);
      // From behind the wall.
      view.setMatrix(matrix, Depth.ReversedInfinite, [6, 0, 0]);
      pipeline.cull(scene, view, visible);
      assert.deepEqual([...visible.ids], [lamp]);
    }
    view.setOrthographic({ ...CAMERA, width: 4, height: 4, near: 0, far: 4.5 });
    visibility.createPipeline().addFrustum().cull(scene, view, visible);
    assert.deepEqual([...visible.ids], [wall]);
    view.setPerspective(CAMERA);
    view.setClipPlanes([[1, 0, 0, -6]]);
    visibility.createPipeline().addFrustum().cull(scene, view, visible);
    assert.deepEqual([...visible.ids], [lamp]);
    view.setLayers(2);
    scene.setLayers(lamp, 4);
    pipeline.cull(scene, view, visible);
    assert.equal(visible.count, 0);
    assert.equal(visible.indices.length, 0);
  });

  test(say("a wall of doubles hides no more than it covers"), () => {
    const { scene, wall, lamp, view, visible } = street();
    // Numbers of single precision are 2 m apart here: the wall ends at y = 2^24 + 1, between two of them.
    const y = 2 ** 24;
    const box = { min: [4, y - 16, -9], max: [5, y + 1, 9] };
    scene.setBounds(wall, box);
    scene.setMesh(wall, scene.addBoxMesh(box));
    scene.setBounds(lamp, { min: [7, y, -1], max: [8, y + 2, 1] });
    view.setPerspective({ ...CAMERA, eye: [0, y + 1.5, 0], target: [1, y + 1.5, 0] });
    visibility.createPipeline().addFrustum().addZBuffer().cull(scene, view, visible);
    assert.ok(visible.contains(scene, lamp), "the lamp reaches a metre beyond the wall");
  });

  test(say("objects are inserted, moved and removed"), () => {
    const { scene, wall, lamp } = street();
    assert.deepEqual([scene.count, scene.indexLimit], [2, 2]);
    scene.setBounds(lamp, { min: [1, 2, 3], max: [4, 5, 6] });
    assert.deepEqual(scene.bounds(lamp), { min: [1, 2, 3], max: [4, 5, 6] });
    scene.setAllBounds([lamp], new Float32Array([0, 0, 0, 1, 1, 1]));
    assert.deepEqual(scene.bounds(lamp).max, [1, 1, 1]);
    // Boxes of doubles are rounded outwards.
    const rounded = { min: [16777220, -16777220, -(2 ** -149)], max: [16777220, -16777218, 2 ** -149] };
    const exact = { min: [16777221, -16777219, -1e-60], max: [16777219.5, -16777219, 1e-60] };
    scene.setBounds(lamp, exact);
    assert.deepEqual(scene.bounds(lamp), rounded);
    scene.setAllBounds([lamp], [...exact.min, ...exact.max]);
    assert.deepEqual(scene.bounds(lamp), rounded);
    const wide = scene.insert({ bounds: exact });
    assert.deepEqual(scene.bounds(wide), rounded);
    scene.remove(wide);
    scene.setLocalBounds(lamp, { min: [0, 0, 0], max: [1, 1, 1] });
    scene.setTransforms([lamp], [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 20, 30, 1]);
    // The library rounds outwards.
    const { min, max } = scene.bounds(lamp);
    assert.deepEqual(
      [min, max].map((corner) => corner.map(Math.round)),
      [
        [10, 20, 30],
        [11, 21, 31],
      ],
    );
    assert.equal(scene.maintain(), 0);
    scene.rebuild();
    scene.remove(wall);
    assert.ok(!scene.contains(wall) && scene.contains(lamp));
    const again = scene.insert({ bounds: WALL, layers: ALL_LAYERS, cost: 3 });
    assert.ok(indexOf(again) === indexOf(wall) && again !== wall);
    scene.setHlodParent(again, lamp);
    scene.setHlodParent(again, NO_OBJECT);
    scene.setDrawRange(again, 0, 100);
    scene.removeAll([again, lamp]);
    assert.equal(scene.count, 0);
  });

  test(say("the judge and meshes of triangles"), () => {
    const { scene, wall, lamp, view, visible } = street();
    const square = (x) => [x, -1, -1, x, 1, -1, x, 1, 1, x, -1, -1, x, 1, 1, x, -1, 1];
    scene.setTriangles(wall, square(4));
    scene.setTriangles(lamp, square(8));
    visibility.createPipeline().addFrustum().addZBuffer().cull(scene, view, visible);
    const comparison = visibility.createJudge(64, 48).compare(scene, view, visible);
    assert.deepEqual(comparison, {
      reportedObjects: 1,
      falseHiddenObjects: 0,
      falseVisibleObjects: 0,
      wrongPixels: 0,
    });

    scene.setBounds(wall, { min: [3, -1, -1], max: [3, 1, 1] });
    const mesh = scene.addMesh({ positions: square(3).slice(0, 9), indices: [0, 1, 2], twoSided: true });
    scene.setMesh(wall, mesh, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    const meshes = scene.meshCount;
    scene.removeMesh(mesh);
    assert.equal(scene.meshCount, meshes, "the wall keeps it");
    assert.throws(() => scene.setMesh(lamp, mesh), refused("UNKNOWN_ID", /mesh/));
    scene.setFlags(lamp, Flag.Occluder);
    assert.equal(scene.prepareOccluders(), 1);
    const lacks = () => visibility.createPipeline().addZBuffer().lacks(scene);
    assert.match(lacks(), /^$/);
    const lost = scene.insert({ bounds: { min: [NaN, 0, 0], max: [1, 1, 1] } });
    assert.match(lacks(), /^pipeline: objects whose bounds are NaN or inverted.*: 1\n$/);
    scene.remove(lost);
  });

  test(say("rooms, doors and baked sets"), () => {
    const rooms = [0, 4, 8].map((x) => ({ min: [x, 0, 0], max: [x + 4, 4, 3] }));
    const door = (x) => [
      [x, 1, 0],
      [x, 2, 0],
      [x, 2, 2],
      [x, 1, 2],
    ];
    const graph = visibility.createGraph(
      3,
      [4, 8].map((x, i) => ({ vertices: door(x), cells: [i, i + 1] })),
    );
    assert.deepEqual(graph.counts, { cells: 3, portals: 2 });
    const cells = visibility.createCells(graph, rooms);
    const scene = visibility.createScene();
    const ids = scene.insertAll({
      bounds: rooms.flatMap(({ min: [x] }) => [x + 1, 1.2, 1, x + 2, 1.4, 1.5]),
    });
    const [view, visible] = [visibility.createView(), visibility.createVisible()];
    view.setPerspective({ ...CAMERA, eye: [0.5, 1.5, 1], target: [9, 1.5, 1] });
    const pipeline = visibility.createPipeline().addFrustum().addPortals(cells);
    const seen = (pipeline) => pipeline.cull(scene, view, visible).visible;
    assert.equal(seen(pipeline), 3);
    cells.setOpen(1, false);
    assert.equal(seen(pipeline), 2);
    assert.ok(cells.canSee(0, 1) && !cells.canSee(0, 2));
    cells.setOpen(1, true);
    cells.setPassage(0, { forward: false, backward: true });
    assert.equal(seen(pipeline), 1);

    const baked = graph.bake();
    assert.deepEqual(baked.counts, { viewcells: 3, targets: 3 });
    assert.ok(baked.sees(0, 2));
    const set = visibility.createPvs(3, [[0], [0, 1], new Uint32Array([1, 2])]);
    assert.deepEqual([...visibility.readPvs(set.bytes).row(2)], [6]);
    const prepared = visibility.createScenePvs(scene, set, rooms, ids, [0, 1, 2]);
    assert.equal(seen(visibility.createPipeline().addPvs(prepared)), 1);
    cells.setPvs(baked);
    assert.throws(() => cells.setOpen(7, true), refused("UNKNOWN_ID", /7/));
  });

  test(say("an eye that walks is told what is hidden, what came and what went"), () => {
    const { scene, wall, lamp, view, visible } = street();
    const online = visibility.createOnline({ viewcell: [0.6, 0.6, 0.6], wide: [4, 4, 1] });
    const pipeline = visibility.createPipeline().addFrustum().addOnline(online);
    assert.equal(pipeline.accuracy, "conservative");
    const frame = (x) => {
      view.setPerspective({ ...CAMERA, eye: [x, 0, 0], near: 0.02 });
      pipeline.cull(scene, view, visible);
      return [...visible.ids].sort();
    };
    assert.deepEqual([frame(0), online.answer], [[wall, lamp], "none"]);
    // At 1 m/s: where the eye is, and where it will be.
    const places = [0, 0.1, 0.2, 0.4].flatMap((seconds) => [seconds, 0, 0]);
    online.step(scene, places, -1);
    assert.notEqual(online.step(scene, places, 0), null, "a budget below 0 is none");
    let [steps, finished, wide] = [0, 0, 0];
    for (let step; (step = online.step(scene, places, 100)) !== null; steps++) {
      finished += step.isFinished;
      wide += step.isWide;
      if (step.isWide && step.isFinished) assert.deepEqual([frame(0), online.answer], [[wall], "wide"]);
    }
    assert.ok(
      steps >= 24 && wide >= 12 && finished >= 2,
      `${steps} steps, ${wide} wide, ${finished} finished`,
    );
    assert.deepEqual([frame(0.1), online.answer], [[wall], "viewcell"]);
    assert.deepEqual([[...online.came], [...online.went]], [[], []]);
    const here = { min: [-0.05, -0.05, -0.05], max: [0.05, 0.05, 0.05] };
    assert.deepEqual([...online.hiddenFrom(scene, here)], [1 << indexOf(lamp)]);
    assert.deepEqual([...online.hiddenFrom(scene, { min: [50, 0, 0], max: [51, 1, 1] })], [0]);

    // What moves shows at once, and so does all without the wall. What is new shows until a box knows of it.
    scene.setBounds(lamp, { min: [7, -1, -1], max: [8, 2, 1] });
    assert.deepEqual([frame(0.1), [...online.came]], [[wall, lamp], [lamp]]);
    const late = scene.insert({ bounds: LAMP });
    assert.deepEqual(frame(0.1), [wall, lamp, late].sort());
    scene.remove(wall);
    assert.deepEqual([frame(0.1), online.answer], [[lamp, late].sort(), "none"]);
    online.destroy();
    assert.deepEqual(frame(0.1), [lamp, late].sort());
    assert.throws(() => online.answer, refused("NULL", /online/));
    assert.throws(() => online.step(scene, places, 1), refused("NULL", /online/));
  });

  test(say("servers are told who sees whom"), () => {
    const corners = [
      [0, 0],
      [8, 0],
      [8, 4],
      [0, 4],
    ];
    const walls = corners.map((from, i) => ({ from, to: corners[(i + 1) % 4] }));
    walls.push({ from: [4, 0], to: [4, 3] }, { from: [4, 3], to: [4, 4], opacity: Opacity.Opaque });
    const player = (x, y) => [x, y, 0, x + 0.6, y + 0.6, 1.8, 0.6];
    const players = [player(1, 1), player(6, 1), player(2.5, 2)].flat();
    const who = visibility.createWhoSees();
    const plan = visibility.createSightCellsOfPlan(walls);
    who.look(plan, players, players);
    assert.deepEqual([...who.seenBy(0)], [0, 2]);
    assert.ok(!who.sees(1, 0) && who.sees(1, 1));
    plan.setOpacity(5, Opacity.Clear);
    who.look(plan, players, players);
    assert.ok(who.sees(1, 0) && who.sees(0, 1));
    // The same plan, upright: its y is the world's z.
    const upright = visibility.createSightCellsOfPlan(walls, { axes: [0, 2] });
    const turn = (numbers) => [0, 2, 1, 3, 5, 4, 6].map((i) => numbers[i]);
    who.look(upright, [...turn(player(1, 1)), ...turn(player(6, 1))], turn(player(6, 1)));
    assert.deepEqual([[...who.seenBy(0)], [...who.seenBy(1)]], [[], [0]]);

    // Boxes on both sides of a long wall, of a scene that stands still and of one that changes.
    const scene = visibility.createScene();
    const wall = { min: [4, -90, -90], max: [4.1, 90, 90] };
    const id = scene.insert({ bounds: wall, flags: Flag.Occluder });
    scene.setMesh(id, scene.addBoxMesh(wall));
    const boxes = [0, 4.2].flatMap((x) => [x, 0, -1, x + 3.9, 4, 3]);
    const sides = [player(1, 1), player(6, 1)].flat();
    const still = visibility.createSightCellsOfScene(scene, boxes);
    who.look(still, sides, sides);
    assert.deepEqual([[...who.seenBy(0)], [...who.seenBy(1)]], [[0], [1]]);
    assert.equal(still.objects.length, 0);
    const online = visibility.createOnline({ viewcell: [2, 2, 3.2], wide: [3, 3, 4], margin: 0.95 });
    const cells = visibility.createOnlineSightCells(scene, online, boxes);
    assert.deepEqual(
      [...cells.objects],
      [...cells.objects].filter((id) => scene.contains(id)),
    );
    who.look(cells, sides, sides, scene);
    assert.deepEqual([...who.seenBy(0)], [0, 1]);
    while (online.step(scene, [1.3, 1.3, 0.9, 6.3, 1.3, 0.9], 10000) !== null);
    const tall = sides.map((x, i) => (i % 7 === 2 ? 0.4 : i % 7 === 5 ? 1.4 : x));
    who.look(cells, tall, tall, scene);
    assert.deepEqual([...who.seenBy(0)], [0]);
    scene.remove(id);
    who.look(cells, tall, tall, scene);
    assert.deepEqual([...who.seenBy(0)], [0, 1]);

    const rooms = [0, 4].map((x) => ({ min: [x, 0, 0], max: [x + 4, 4, 3] }));
    const graph = visibility.createGraph(2, []);
    const apart = visibility.createSightCellsOfPortals(graph, rooms, graph.bake());
    who.look(apart, sides, sides);
    assert.deepEqual([...who.seenBy(0)], [0]);
  });

  test(say("online sets and sight cells refuse what is wrong by name"), () => {
    const { scene } = street();
    const sizes = { viewcell: [0.6, 0.6, 0.6], wide: [4, 4, 1] };
    const online = visibility.createOnline(sizes);
    const sized = (change) => () => visibility.createOnline({ ...sizes, ...change });
    assert.throws(() => visibility.createOnline(), refused("ARGUMENT", /`viewcell`/));
    assert.throws(sized({ viewcell: [0.6, NaN, 0.6] }), refused("ARGUMENT", /on axis 1, viewcells of NaN m/));
    assert.throws(
      sized({ wide: [4, 4, 0.5] }),
      refused("ARGUMENT", /on axis 2, viewcells of 0.6 m do not fit/),
    );
    assert.throws(sized({ margin: -1 }), refused("ARGUMENT", /margin cannot be -1/));
    assert.throws(sized({ margin: NaN }), refused("ARGUMENT", /is missing, or/));
    assert.throws(() => online.step(scene, [0, 0], 9), refused("ARGUMENT", /`places` is no multiple of 3/));
    assert.throws(() => online.step(scene, [0, 0, NaN], 9), refused("ARGUMENT", /place 0 is not finite/));
    assert.throws(() => online.step(scene, [0, 0, 0]), refused("ARGUMENT", /`budget` is not a whole number/));
    assert.throws(() => online.step(foreign, [0, 0, 0], 9), refused("ARGUMENT", /a scene of this library/));
    const far = { min: [0, 0, 0], max: [0, 0, Infinity] };
    assert.throws(() => online.hiddenFrom(scene, far), refused("ARGUMENT", /`max` is not finite/));
    assert.throws(() => online.hiddenFrom(scene), refused("ARGUMENT", /`min`/));
    assert.throws(
      () => visibility.createPipeline().addOnline(scene),
      refused("ARGUMENT", /an? online of this/),
    );
    const wall = { from: [0, 0], to: [0, 1] };
    const plan = (...walls) => visibility.createSightCellsOfPlan(walls);
    assert.throws(() => plan({ from: [0, 0] }), refused("ARGUMENT", /./));
    assert.throws(() => plan({ ...wall, to: [0, NaN] }), refused("ARGUMENT", /of number 0 has a coordinate/));
    assert.throws(() => plan({ ...wall, opacity: 7 }), refused("ARGUMENT", /7 is no vis_opacity/));
    assert.throws(() => visibility.createSightCellsOfPlan([], { axes: [1, 1] }), refused("ARGUMENT", /axes/));
    assert.throws(() => plan(wall).setOpacity(1, 0), refused("UNKNOWN_ID", /wall 1 is unknown/));
    const boxes = [0, 0, 0, 1, 1, NaN];
    const inverted = refused("ARGUMENT", /box 0 is inverted or not finite/);
    assert.throws(() => visibility.createSightCellsOfScene(scene, boxes), inverted);
    assert.throws(() => visibility.createOnlineSightCells(scene, online, boxes), inverted);
    assert.equal(scene.count, 2);
    const [who, cells] = [visibility.createWhoSees(), plan(wall)];
    const mover = [0, 0, 0, 1, 1, 1, 0];
    who.look(cells, mover, mover);
    assert.throws(() => who.look(cells, mover.with(6, NaN), mover), refused("ARGUMENT", /observer 0 needs/));
    assert.throws(() => who.look(cells, mover, mover.with(0, 2)), refused("ARGUMENT", /target 0 needs/));
    assert.throws(() => who.look(online, mover, mover), refused("ARGUMENT", /sight_cells of this library/));
    const added = visibility.createOnlineSightCells(scene, online, []);
    assert.throws(() => who.look(added, mover, mover), refused("NULL", /scene/));
    assert.ok(who.sees(0, 0));
    assert.throws(() => who.sees(0, 1), refused("UNKNOWN_ID", /no target 1/));
    assert.throws(() => who.seenBy(1), refused("UNKNOWN_ID", /no observer 1/));
    assert.throws(() => who.seenBy(0.5), refused("ARGUMENT", /`observer` is not a whole number/));
  });

  test(say("a plan tells what an eye sees, and a door opens"), () => {
    // A wall across, 2 wide at x = 5, and one behind it, 1 wide at x = 9.
    const walls = [
      { from: [5, -1], to: [5, 1] },
      { from: [9, -0.5], to: [9, 0.5], opacity: Opacity.Clear },
    ];
    const plan = visibility.createPlan(walls);
    assert.deepEqual([plan.sees([0, 0], [9, 0]), plan.sees([0, 0], [9, 5])], [false, true]);
    assert.deepEqual([...plan.walls([0, 0])], [0]);
    assert.deepEqual(plan.ray([0, 0], [1, 0]), { point: [5, 0], wall: 0 });
    assert.equal(plan.ray([4, 0], [5, 5]).wall, null);
    assert.equal(plan.ray([0, 0], [0, 0]), null);
    assert.deepEqual([...plan.wallsFromRegion([4.5, 0])], [0]);
    assert.deepEqual([...plan.wallsFromRegion([4.5, -1.5, 4.5, 1.5])], [0, 1]);
    const distances = (corners) =>
      [...corners.filter((_, i) => i % 2 === 0)].map((x, i) => Math.hypot(x - 7, corners[2 * i + 1]));
    const corners = plan.polygon([7, 0], { range: 1.5 });
    assert.ok(corners.length > 20 && distances(corners).every((distance) => distance < 1.5001));
    assert.ok(Math.max(...plan.polygon([7, 0])) > 9.4, "through the clear wall");
    plan.setOpacity(0, Opacity.Clear);
    assert.deepEqual([plan.sees([0, 0], [9, 0]), ...plan.walls([0, 0])], [true, 0, 1]);
    // From the left of a wall to its right: from -x to +x along -y, from +x to -x along +y.
    plan.setOpacity(0, Opacity.OneWay);
    assert.deepEqual([plan.sees([0, 0], [8, 0]), plan.sees([8, 0], [0, 0])], [true, false]);
    assert.throws(() => plan.setOpacity(2, Opacity.Opaque), refused("UNKNOWN_ID", /2/));
    assert.throws(() => plan.sees([0, 0, 0], [1, 1]), refused("ARGUMENT", /`a` is not a list of 2/));
    assert.throws(() => plan.sees([0, NaN], [1, 1]), refused("ARGUMENT", /NaN/));
    assert.throws(() => visibility.createPlan([{ from: [0, 0], to: [1, 0], opacity: 3 }]), refused("ARGUMENT", /3/));
  });

  test(say("a region sees what is not behind the wall for all of it"), () => {
    const { scene, wall, lamp } = street();
    const [x, y] = [4, 9];
    scene.setTriangles(lamp, [7, -1, -1, 7, 1, -1, 7, 1, 1]);
    scene.setTriangles(wall, [x, -y, -y, x, y, -y, x, y, y, x, -y, -y, x, y, y, x, -y, y]);
    const before = { min: [-1, -1, -1], max: [1, 1, 1] };
    const around = { min: [-1, -1, -1], max: [6, 1, 1] };
    assert.deepEqual([[...scene.seenFrom(before)], [...scene.seenFrom(around)]], [[0b01], [0b11]]);
    const words = ({ seen, hidden }) => [...seen, ...hidden];
    assert.deepEqual(words(scene.proveFrom(before)), [0b01, 0b10]);
    assert.deepEqual(words(scene.proveFrom(before, { mostSteps: 1 })), [0, 0]);
    assert.deepEqual(words(scene.proveFrom(around)), [0b11, 0]);
    scene.setFlags(lamp, Flag.NeverCull);
    assert.deepEqual(words(scene.proveFrom(before)), [0b01, 0], "a lamp that is never culled");
    assert.throws(() => scene.seenFrom({ min: [2, 0, 0], max: [1, 0, 0] }), refused("ARGUMENT", /inverted/));
    assert.throws(() => scene.proveFrom(before, { clearance: -1 }), refused("ARGUMENT", /clearance/));
  });

  test(say("queries, casters and occluders of a level"), () => {
    const { scene, wall, lamp, view, visible } = street();
    const ray = { origin: [0, 0, 0], direction: [2, 0, 0] };
    const hits = scene.rayHits(ray);
    assert.deepEqual(hits.map(({ id }) => id), [wall, lamp]);
    assert.ok(hits.every(({ distance }, i) => distance > [3.99, 6.99][i] && distance <= [4, 7][i]));
    assert.equal(scene.firstHit(ray).id, wall);
    assert.equal(scene.firstHit({ ...ray, maxDistance: 3 }), null);
    assert.equal(scene.firstHit({ ...ray, direction: [-1, 0, 0] }), null);
    assert.deepEqual([...scene.inBox({ min: [6, 0, 0], max: [9, 9, 9] })], [lamp]);
    assert.deepEqual([...scene.inBox(WALL, { layers: 0 })], []);
    assert.throws(() => scene.firstHit({ origin: [0, 0, 0], direction: [0, 0, 0] }), refused("ARGUMENT", /direction/));

    const casters = (light) => {
      visibility.createPipeline().addCasters(light).cull(scene, view, visible);
      return visible.bits[0];
    };
    view.setPerspective({ ...CAMERA, far: 3 });
    assert.equal(casters({ toward: [1, 0, 0] }), 0b11);
    assert.equal(casters({ toward: [-1, 0, 0] }), 0b00);
    assert.equal(casters({ position: [20, 0, 0] }), 0b11);
    // The wall ends 15 m from the light, the lamp 12 m.
    assert.equal(casters({ position: [20, 0, 0], range: 13 }), 0b10);
    assert.equal(casters({ position: [20, 0, 0], direction: [0, 1, 0], halfAngle: 0.2 }), 0b00);
    assert.throws(() => casters({ toward: [0, 0, 0] }), refused("ARGUMENT", /direction/));
    assert.throws(() => casters({}), refused("ARGUMENT", /position/));

    // The wall hides nothing; a level of two triangles at x = 6 does.
    scene.setFlags(wall, 0);
    view.setPerspective(CAMERA);
    const triangles = [6, -9, -9, 6, 9, -9, 6, 9, 9, 6, -9, -9, 6, 9, 9, 6, -9, 9];
    const level = visibility.createLevel(triangles, { twoSided: true });
    const seen = (level, options) => {
      visibility.createPipeline().addFrustum().addZBufferOfLevel(level, options).cull(scene, view, visible);
      return visible.bits[0];
    };
    assert.equal(seen(level), 0b01);
    assert.equal(seen(visibility.readLevel(level.bytes)), 0b01);
    assert.equal(seen(level, { origin: [3, 0, 0] }), 0b11);
    assert.throws(() => visibility.readLevel(level.bytes.slice(1)), refused("FORMAT", /./));
    assert.throws(() => visibility.createLevel([1, 2]), refused("ARGUMENT", /multiple of 9/));
  });

  test(say("levels of detail follow the size in pixels, with a fade and by draw ranges"), () => {
    const scene = visibility.createScene();
    // Cubes of 1 m, 10 and 40 m ahead, and one that fades from 30 to 50 m.
    const cube = (x, y) => [x, y, 0, x + 1, y + 1, 1];
    const [near, far, fading] = scene.insertAll({ bounds: [cube(10, 1), cube(40, 1), cube(40, -2)].flat() });
    // In a picture of 1000 rows, a sphere sqrt(3) m wide has 1.73 / 10 * SCALE * 500 = 159 pixels at 10 m, 40 at 40 m.
    scene.setLodSizes([near, far], [100, 50]);
    scene.setDrawRange(fading, 0, 50, 20);
    const [view, visible] = [visibility.createView(), visibility.createVisible()];
    const pipeline = visibility.createPipeline().addFrustum().addContribution(1000, 1);
    const lods = visibility.createLods(1000, { hysteresis: 0.1, fade: 0.5 });
    const frame = (x, seconds = 0.25) => {
      view.setPerspective({ ...CAMERA, eye: [x, 0, 0], target: [x + 1, 0, 0] });
      pipeline.cull(scene, view, visible);
      visible.sortByIndex(scene);
      lods.select(scene, view, visible, seconds);
      const { ids, levels, previous, fades, opacities } = lods.selected;
      ids.forEach((id, i) => {
        const at = { level: levels[i], previous: previous[i], fade: fades[i], opacity: opacities[i] };
        assert.deepEqual(lods.lod(id), at);
      });
      return { ids: [...ids], levels: [...levels], previous: [...previous], fades: [...fades], opacities };
    };
    const first = frame(0);
    assert.deepEqual(first.ids, [near, far, fading]);
    assert.deepEqual([first.levels, first.previous, first.fades], [[0, 2, 0], [0, 2, 0], [1, 1, 1]]);
    assert.ok(first.opacities[0] === 1 && Math.abs(first.opacities[2] - 0.5) < 0.01, `${first.opacities}`);
    // From 21 m on, the far cube is 84 pixels, beyond 50 by more than the hysteresis: half a second of a fade.
    const second = frame(21);
    assert.deepEqual([second.ids, second.levels], [[far, fading], [1, 0]]);
    assert.deepEqual([second.previous[0], second.fades[0], second.opacities[1]], [2, 0, 1]);
    assert.deepEqual([frame(21).fades[0], frame(21).fades[0]], [0.5, 1]);
    // At 47 pixels the level stays by the hysteresis; after a reset it is that of the size.
    assert.deepEqual([frame(6.5).levels[1], lods.lod(near).level], [1, 0]);
    assert.equal(lods.lod(999n), null);
    lods.reset();
    assert.deepEqual([frame(6.5).levels[1], frame(6.5).fades[1]], [2, 1]);
    lods.setPictureHeight(0);
    lods.reset();
    assert.deepEqual(frame(0).levels, [0, 0, 0], "without a height all is fine");
    // Seen from far behind, the one with a range is beyond its end.
    pipeline.setContribution(1000, 1, [-30, 0, 0]);
    lods.setDistanceEye([-5, 0, 0]);
    assert.deepEqual(frame(0).ids, [near, far]);
    pipeline.setContribution(1000, 1);
    assert.ok(Math.abs(frame(0).opacities[2] - 0.25) < 0.01, "the margin, 45 m from the eye of the camera");
    lods.setDistanceEye();
    assert.ok(Math.abs(frame(0).opacities[2] - 0.5) < 0.01, "the margin, from the view's own eye");

    assert.throws(() => visibility.createLods(), refused("ARGUMENT", /is missing, or/));
    assert.throws(() => visibility.createLods(-1), refused("ARGUMENT", /the picture height cannot be -1/));
    const odd = (options) => () => visibility.createLods(1000, options);
    assert.throws(odd({ hysteresis: 1 }), refused("ARGUMENT", /the hysteresis cannot be 1/));
    assert.throws(odd({ fade: -1 }), refused("ARGUMENT", /the fade cannot be -1/));
    assert.throws(() => scene.setLodSizes([near], [5, 0]), refused("ARGUMENT", /size 1 cannot be 0/));
    assert.throws(() => scene.setLodSizes([near, 7n], [5]), refused("UNKNOWN_ID", /7/));
    assert.throws(() => scene.setLodSizes([1], [5]), refused("ARGUMENT", /ids are bigint/));
    assert.throws(() => lods.select(scene, view, visible, -1), refused("ARGUMENT", /elapsed time cannot be -1/));
    assert.throws(() => lods.select(scene, view, visible), refused("ARGUMENT", /is missing, or/));
    assert.throws(() => lods.select(foreign, view, visible, 0), refused("ARGUMENT", /a scene of this library/));
    assert.throws(() => lods.setDistanceEye([0, NaN, 0]), refused("ARGUMENT", /`eye` is not finite/));
    assert.throws(() => pipeline.setContribution(1, 1, [0]), refused("ARGUMENT", /`distanceEye` is not a list/));
    assert.throws(
      () => visibility.createPipeline().setContribution(1, 1),
      refused("STATE", /has no contribution culling/),
    );
    lods.destroy();
    assert.throws(() => lods.selected, refused("NULL", /lods/));
  });

  test(say("draw lists group by mesh and level, and make the commands"), () => {
    const scene = visibility.createScene();
    const cube = (x, y) => [x, y, 0, x + 1, y + 1, 1];
    const ids = scene.insertAll({ bounds: [cube(10, 1), cube(40, 1), cube(40, -2), cube(12, -2), cube(-9, 0)].flat() });
    const [view, visible] = [visibility.createView(), visibility.createVisible()];
    const [list, lods] = [visibility.createDrawList(), visibility.createLods(1000, { fade: 1 })];
    const pipeline = visibility.createPipeline().addFrustum();
    const frame = (x) => {
      view.setPerspective({ ...CAMERA, eye: [x, 0, 0], target: [x + 1, 0, 0] });
      pipeline.cull(scene, view, visible);
      visible.sortByIndex(scene);
      lods.select(scene, view, visible, 0.25);
    };
    const content = () => [[...list.groups], [...list.instances]];
    assert.deepEqual(content(), [[], []]);
    // Two meshes of two levels each: keys 0 and 1, and 4 and 5. At 100 pixels the level changes: 16 m away, with the hysteresis 14.
    scene.setDrawKeys(ids, [4, 0, 4, 0, 0]);
    scene.setLodSizes(ids, [100]);
    frame(0);
    list.group(scene, visible);
    assert.deepEqual(content(), [[0, 0, 2, 4, 2, 2], [1, 3, 0, 2]]);
    list.groupLevels(scene, lods);
    assert.deepEqual(content(), [[0, 0, 1, 1, 1, 1, 4, 2, 1, 5, 3, 1], [3, 1, 0, 2]]);
    const meshes = [36, 77, 0, -5, 77, 12, 0, 36, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 6, 1, 48, 0, 0, 3, 1, 54, 0, 0];
    const base = -5 >>> 0;
    const expected = [36, 1, 0, base, 0, 12, 1, 36, 9, 1, 6, 1, 48, 0, 2, 3, 1, 54, 0, 3];
    assert.deepEqual([...list.commands(meshes)], expected);
    assert.deepEqual([...list.commands(new Int32Array(meshes))], expected);
    assert.deepEqual([...list.commands(new Uint32Array(meshes))], expected);
    list.groupFading(scene, lods);
    assert.deepEqual(content(), [[], []]);
    frame(30);
    list.groupFading(scene, lods);
    assert.deepEqual(content(), [[1, 0, 1, 5, 1, 1], [1, 2]], "the level before");
    list.groupLevels(scene, lods);
    assert.deepEqual(content(), [[0, 0, 1, 4, 1, 1], [1, 2]], "the level to draw");
    scene.remove(ids[1]);
    list.groupLevels(scene, lods);
    assert.deepEqual(content(), [[4, 0, 1], [2]]);

    assert.throws(() => list.commands([1, 2, 3]), refused("ARGUMENT", /multiple of 5/));
    assert.throws(() => list.commands([1, 1, 1, 1, 1]), refused("ARGUMENT", /key 4 is not below 1/));
    assert.throws(() => list.commands([1, 1, 1, 1, 0.5]), refused("ARGUMENT", /not a whole number/));
    assert.throws(() => list.group(scene, lods), refused("ARGUMENT", /a visible of this library/));
    assert.throws(() => list.groupLevels(scene, visible), refused("ARGUMENT", /a lods of this library/));
    assert.throws(() => list.group(scene, visibility.createVisible()), refused("STATE", /no pipeline/));
    assert.throws(() => scene.setDrawKeys([ids[0]], [1, 2]), refused("ARGUMENT", /`keys` has 2 elements, not 1/));
    assert.throws(() => scene.setDrawKeys([ids[0]], [0.5]), refused("ARGUMENT", /not a whole number/));
    assert.throws(() => scene.setDrawKeys([ids[0]], [4294967041]), refused("ARGUMENT", /the key 4294967041/));
    for (const keys of [[-256], [-1], new Int32Array([-256])])
      assert.throws(() => scene.setDrawKeys([ids[0]], keys), refused("ARGUMENT", /`keys` has a negative number/));
    assert.throws(() => scene.setDrawKeys([ids[1]], [1]), refused("UNKNOWN_ID", /1/));
    assert.deepEqual(content(), [[4, 0, 1], [2]]);
  });

  test(say("the module for frames has levels of detail and draw lists"), async () => {
    const frames = await load({ simd128, frames: true });
    const scene = frames.createScene();
    const [id] = scene.insertAll({ bounds: [...LAMP.min, ...LAMP.max] });
    scene.setLodSizes([id], [1e6]);
    scene.setDrawKeys([id], [3]);
    const [view, visible, lods, list] = [
      frames.createView(),
      frames.createVisible(),
      frames.createLods(100),
      frames.createDrawList(),
    ];
    view.setPerspective(CAMERA);
    frames.createPipeline().addFrustum().addContribution(100, 1).cull(scene, view, visible);
    lods.select(scene, view, visible, 0);
    list.groupLevels(scene, lods);
    assert.deepEqual([[...list.groups], [...list.instances]], [[4, 0, 1], [0]]);
    assert.throws(() => frames.createGraph(1, []), refused("STATE", /whole module/));
  });

  test(say("mirrors show what is before them, and mirrors in them"), () => {
    const rooms = [0, 4].map((x) => ({ min: [x, 0, 0], max: [x + 4, 4, 3] }));
    const rectangle = (x) => [
      [x, 1, 0.5],
      [x, 3, 0.5],
      [x, 3, 2.5],
      [x, 1, 2.5],
    ];
    const graph = visibility.createGraph(2, [{ vertices: rectangle(4), cells: [0, 1] }]);
    const cells = visibility.createCells(graph, rooms);
    // At both ends of the row, facing each other.
    const glass = [rectangle(8).reverse(), rectangle(0)];
    assert.deepEqual([cells.addMirror(1, glass[0]), cells.addMirror(0, glass[1])], [0, 1]);
    const scene = visibility.createScene();
    const cube = (x, y) => [x, y, 1, x + 0.5, y + 0.5, 1.5];
    // In view; behind the eye in its room; and in the corner beside the door, which no mirror shows.
    const ids = scene.insertAll({ bounds: [cube(6, 2), cube(0.2, 2), cube(4.2, 0.1)].flat() });
    const [view, visible] = [visibility.createView(), visibility.createVisible()];
    const [mirrored, shown] = [visibility.createView(), visibility.createVisible()];
    const reflections = visibility.createReflections(cells);
    const pipeline = visibility.createPipeline().addFrustum().addReflections(reflections);
    const frame = () => {
      view.setPerspective({ ...CAMERA, eye: [1.5, 2, 1.5], target: [9, 2, 1.5] });
      pipeline.cull(scene, view, visible);
      return reflections.list;
    };
    assert.deepEqual(reflections.list, []);
    assert.deepEqual(frame(), [
      { mirror: 0, parent: null, depth: 1 },
      { mirror: 1, parent: 0, depth: 2 },
    ]);
    assert.equal(reflections.leftOut, 1);
    assert.deepEqual([...visible.ids], [ids[0]]);
    reflections.read(0, mirrored, shown);
    shown.sortByIndex(scene);
    assert.ok(shown.contains(scene, ids[1]) && shown.contains(scene, ids[0]), `${shown.indices}`);
    // The reflected matrix sees a point where the matrix of the eye sees the point's reflection in x = 8.
    const clip = (m, [x, y, z]) => [0, 1, 2, 3].map((i) => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]);
    const [from, to] = [
      [0.4, 2.2, 1.2],
      [15.6, 2.2, 1.2],
    ];
    const near = (a, b) => a.every((x, i) => Math.abs(x - b[i]) < 1e-9);
    assert.ok(near(clip(mirrored.matrix(), from), clip(view.matrix(), to)));
    const far = [100, 200, 300];
    assert.ok(near(clip(mirrored.matrix(far), from.map((x, i) => x - far[i])), clip(view.matrix(), to)));
    const [[a, b, c, d], ...others] = mirrored.clipPlanes();
    assert.ok(near([a, b, c], [-1, 0, 0]) && Math.abs(d - 8) < 1e-5 && others.length === 0, `${[a, b, c, d]}`);
    assert.ok(Math.abs(mirrored.clipPlanes(far)[0][3] - (8 - 100)) < 1e-5);
    assert.deepEqual(view.clipPlanes(), []);
    // The mirror's set is a frame's result: levels, draw lists, and again a view.
    const lods = visibility.createLods(100);
    lods.select(scene, mirrored, shown, 0);
    assert.deepEqual([...lods.selected.ids], [...shown.ids]);
    scene.insert({ bounds: WALL });
    assert.equal(shown.count, lods.selected.ids.length);

    cells.setMirror(1, false);
    assert.deepEqual(frame(), [{ mirror: 0, parent: null, depth: 1 }]);
    cells.setOpen(0, false);
    assert.deepEqual(frame(), []);
    assert.throws(() => reflections.read(0, mirrored, shown), refused("UNKNOWN_ID", /no reflection 0/));
    assert.throws(() => reflections.read(0, shown, mirrored), refused("ARGUMENT", /a view of this library/));
    assert.throws(() => cells.addMirror(2, glass[0]), refused("UNKNOWN_ID", /no cell 2/));
    assert.throws(() => cells.addMirror(0, glass[0].slice(2)), refused("ARGUMENT", /./));
    assert.throws(() => cells.addMirror(0, [[1, 2]]), refused("ARGUMENT", /a vertex has 3 numbers/));
    assert.throws(() => cells.setMirror(2, true), refused("UNKNOWN_ID", /no mirror 2/));
    assert.throws(() => cells.setMirror(0, 1), refused("ARGUMENT", /is not true or false/));
    assert.throws(() => visibility.createReflections(graph), refused("ARGUMENT", /a cells of this library/));
    assert.throws(() => pipeline.addReflections(cells), refused("ARGUMENT", /a reflections of this library/));
    assert.throws(() => view.matrix([NaN, 0, 0]), refused("ARGUMENT", /`origin` is not finite/));
    // Both mirrors again: the limits leave out the mirror in the mirror, or all.
    cells.setOpen(0, true);
    cells.setMirror(1, true);
    const limited = (options) => {
      const few = visibility.createReflections(cells, options);
      visibility.createPipeline().addReflections(few).cull(scene, view, visible);
      return [few.list.length, few.leftOut];
    };
    const counts = [{}, { maxDepth: 1 }, { maxCount: 1 }, { maxCount: 0 }, { maxDepth: 3 }].map(limited);
    assert.deepEqual(counts, [[2, 1], [1, 1], [1, 1], [0, 1], [3, 1]]);

    // A set with changes still has them after a reflection was read into it.
    const changing = visibility.createVisible({ changes: true });
    frame();
    reflections.read(0, mirrored, changing);
    assert.deepEqual([...changing.newlyVisible], []);
    pipeline.cull(scene, view, changing);
    assert.deepEqual([...changing.newlyVisible], [...changing.ids]);
    assert.equal(changing.newlyVisible.length > 0, true);
    // The object that is drawn to 4.8 m is in the mirror, too: the camera is 4.5 m from it, the reflected eye 8 m.
    pipeline.addContribution(1000, 0);
    const shows = (end) => {
      scene.setDrawRange(ids[0], 0, end);
      frame();
      reflections.read(0, mirrored, shown);
      return [visible.contains(scene, ids[0]), shown.contains(scene, ids[0])];
    };
    assert.deepEqual([4.8, 4].map(shows), [[true, true], [false, false]]);
  });

  test(say("a list is asked for once, unless it is longer than before"), async () => {
    const { instantiate } = WebAssembly;
    const counts = {};
    WebAssembly.instantiate = async (...given) => {
      const made = await instantiate(...given);
      const counted = (name, call) => (...of) => {
        counts[name] = (counts[name] ?? 0) + 1;
        return call(...of);
      };
      const exports = {};
      for (const [name, value] of Object.entries((made.instance ?? made).exports))
        exports[name] = typeof value === "function" ? counted(name, value) : value;
      return made.instance ? { instance: { exports } } : { exports };
    };
    const other = await load({ simd128 }).finally(() => (WebAssembly.instantiate = instantiate));
    const plan = other.createPlan([{ from: [5, -1], to: [5, 1] }]);
    const corners = plan.polygon([0, 0]);
    assert.equal(counts.vis_plan_visibility_polygon, 1, "a short list");
    assert.deepEqual(plan.polygon([0, 0]), corners);
    const scene = other.createScene();
    const count = 5000;
    scene.insertAll({ bounds: Float64Array.from({ length: 6 * count }, (_, i) => (i % 6 < 3 ? 1 : 2)) });
    const all = [scene.inBox(WALL), scene.inBox({ min: [0, 0, 0], max: [3, 3, 3] })].map((ids) => ids.length);
    assert.deepEqual(all, [0, count]);
    assert.equal(counts.vis_scene_in_box, 3, "a long list, the first time");
    assert.equal(scene.inBox({ min: [0, 0, 0], max: [3, 3, 3] }).length, count);
    assert.equal(counts.vis_scene_in_box, 4, "a long list, again");
  });

  test(say("errors name what is wrong"), () => {
    const { scene, wall, view, visible } = street();
    assert.throws(
      () => view.setPerspective({ ...CAMERA, fovY: 7 }),
      refused("ARGUMENT", /fov_y cannot be 7/),
    );
    assert.throws(() => view.setMatrix(new Float32Array(16), Depth.Reversed), refused("ARGUMENT", /matrix/));
    assert.throws(
      () => view.setMatrix([1, 2], Depth.Reversed),
      refused("ARGUMENT", /`matrix` has 2 elements, not 16/),
    );
    assert.throws(() => view.setMatrix(MATRIX, 17), refused("ARGUMENT", /17/));
    assert.throws(() => scene.remove(77n), refused("UNKNOWN_ID", /77/));
    assert.throws(() => scene.insertAll({ bounds: [1, 2, 3] }), refused("ARGUMENT", /multiple of 6/));
    assert.throws(() => scene.insert({ bounds: WALL, flags: 64 }), refused("ARGUMENT", /0x40/));
    assert.throws(() => scene.setBounds(wall, { min: [1], max: [2] }), refused("ARGUMENT", /`min`/));
    assert.throws(() => scene.insert({}), refused("ARGUMENT", /`min`/));
    assert.throws(() => scene.insert(), refused("ARGUMENT", /`min`/));
    assert.throws(() => scene.insertAll({}), refused("ARGUMENT", /`bounds`/));
    assert.throws(() => scene.addMesh({ positions: [0, 0, 0] }), refused("ARGUMENT", /`indices`/));
    assert.throws(() => scene.setBounds(1, WALL), refused("ARGUMENT", /ids are bigint/));
    assert.throws(() => scene.setBounds(wall), refused("ARGUMENT", /`min`/));
    assert.throws(() => scene.removeAll([1]), refused("ARGUMENT", /ids are bigint/));
    assert.throws(() => visibility.createPipeline().explain(1), refused("ARGUMENT", /ids are bigint/));
    assert.throws(() => view.setPerspective(), refused("ARGUMENT", /`eye`/));
    assert.throws(() => visibility.createGraph(2), refused("ARGUMENT", /./));
    assert.throws(() => visible.indices, refused("STATE", /./));
    assert.throws(() => visibility.readPvs(new Uint8Array(9)), refused("FORMAT", /./));
    assert.throws(() => visibility.readScenePvs(scene, new Uint8Array(9)), refused("FORMAT", /./));
    assert.throws(() => visibility.readScenePvs(scene, new Uint8Array(9), 1n), refused("FORMAT", /./));
    assert.throws(() => visibility.readPrt("PRT9"), refused("FORMAT", /./));
    const pipeline = visibility.createPipeline();
    assert.throws(() => pipeline.cull(view, scene, visible), refused("ARGUMENT", /a scene of this library/));
    assert.throws(() => pipeline.addPortals(undefined), refused("ARGUMENT", /cells/));
    assert.throws(
      () => pipeline.cull(foreign, view, visible),
      refused("ARGUMENT", /a scene of this library/),
    );
    assert.throws(() => visibility.createPipeline().addZBuffer(1, 1), refused("ARGUMENT", /./));
    scene.destroy();
    assert.throws(() => scene.count, refused("NULL", /scene/));
    scene.destroy();
  });

  test(say("no missing or mistyped argument closes a door or empties a layer"), () => {
    const { scene, wall, view } = street();
    const door = [1, 2, 2, 1].map((y, i) => [4, y, i < 2 ? 0 : 2]);
    const rooms = [0, 4].map((x) => ({ min: [x, 0, 0], max: [x + 4, 4, 3] }));
    const cells = visibility.createCells(
      visibility.createGraph(2, [{ vertices: door, cells: [0, 1] }]),
      rooms,
    );
    const pvs = visibility.createPvs(1, [[0]]);
    const pipeline = visibility.createPipeline().addFrustum();
    for (const wrong of [undefined, null, NaN, 0.5, 1, 2, "true", 1n]) {
      const isRefused = refused("ARGUMENT", /is not true or false/);
      assert.throws(() => cells.setOpen(0, wrong), isRefused);
      assert.throws(() => cells.setPassage(0, { forward: true, backward: wrong }), isRefused);
      assert.throws(() => visibility.createVisible({ changes: wrong ?? null }), isRefused);
    }
    const whole = /is not a whole number of 32 bits/;
    for (const wrong of [undefined, null, NaN, Infinity, 0.5, 2 ** 32, -(2 ** 31) - 1, true, "1", 1n]) {
      assert.throws(() => cells.setOpen(wrong, true), refused("ARGUMENT", whole));
      assert.throws(() => scene.setLayers(wall, wrong), refused("ARGUMENT", whole));
      assert.throws(() => scene.setFlags(wall, wrong), refused("ARGUMENT", whole));
      assert.throws(() => view.setLayers(wrong), refused("ARGUMENT", whole));
      const bounds = [...WALL.min, ...WALL.max];
      assert.throws(() => scene.insertAll({ bounds, layers: [wrong] }), refused("ARGUMENT", whole));
      const indices = [0, 1, wrong];
      assert.throws(() => scene.addMesh({ positions: bounds, indices }), refused("ARGUMENT", whole));
      assert.throws(() => view.setMatrix(MATRIX, wrong), refused("ARGUMENT", whole));
      assert.throws(() => pipeline.stageStats(wrong), refused("ARGUMENT", whole));
      assert.throws(() => visibility.createGraph(wrong, []), refused("ARGUMENT", whole));
      assert.throws(() => cells.canSee(wrong, 1), refused("ARGUMENT", whole));
      assert.throws(() => cells.canSee(0, wrong), refused("ARGUMENT", whole));
      assert.throws(() => visibility.createPvs(wrong, []), refused("ARGUMENT", whole));
      assert.throws(() => pvs.sees(wrong, 0), refused("ARGUMENT", whole));
      assert.throws(() => pvs.sees(0, wrong), refused("ARGUMENT", whole));
      assert.throws(() => pvs.row(wrong), refused("ARGUMENT", whole));
    }
    for (const wrong of [NaN, Infinity, 0.5, 2 ** 32]) {
      for (const Type of [Float32Array, Float64Array]) {
        const mesh = { positions: new Float32Array(9), indices: Type.of(0, 1, wrong) };
        assert.throws(() => scene.addMesh(mesh), refused("ARGUMENT", whole));
        assert.throws(() => visibility.createPvs(1, [Type.of(wrong)]), refused("ARGUMENT", whole));
        const prepare = () => visibility.createScenePvs(scene, pvs, [WALL], [wall], Type.of(wrong));
        assert.throws(prepare, refused("ARGUMENT", whole));
      }
    }
    assert.throws(() => view.setPerspective({ ...CAMERA, near: NaN }), refused("ARGUMENT", /is missing, or/));
    view.setLayers(~4);
    assert.equal(scene.count, 2);
    assert.ok(cells.canSee(0, 1) && cells.canSee(1, 0));
  });

  test(say("after a fault inside the library, every call says so"), async () => {
    // Modules whose function `f` is one instruction: a trap, and a call of itself without end.
    const functionOf = async (...instruction) => {
      const begin = [0, 97, 115, 109, 1, 0, 0, 0, 1, 4, 1, 96, 0, 0, 3, 2, 1, 0, 7, 5, 1, 1, 102, 0, 0, 10];
      const { length } = instruction;
      const module = [...begin, length + 4, 1, length + 2, 0, ...instruction, 11];
      return (await WebAssembly.instantiate(new Uint8Array(module), {})).instance.exports.f;
    };
    const trap = await functionOf(0);
    const overflow = await functionOf(16, 0);
    for (const [fault, message] of [
      [trap, /fault inside the library: unreachable/],
      [overflow, /fault inside the library: .*stack/],
    ]) {
      const handle = (await load({ simd128 })).createScene();
      const { exports } = handle.wasm;
      handle.wasm.exports = { ...exports, vis_scene_count: fault };
      assert.throws(() => handle.count, refused("PANIC", message));
      handle.wasm.exports = { ...exports, vis_scene_destroy: fault, vis_free: fault };
      assert.throws(() => handle.count, refused("PANIC", /an earlier fault inside the library/));
      handle.destroy();
    }
    for (const [name, use] of [
      ["vis_scene_destroy", (handle) => handle.destroy()],
      ["vis_free", (handle) => handle.destroy()],
      ["vis_alloc", (handle) => handle.insertAll({ bounds: new Float64Array(6000) })],
      ["vis_last_error", (handle) => handle.remove(5n)],
    ]) {
      const handle = (await load({ simd128 })).createScene();
      const { exports } = handle.wasm;
      handle.wasm.exports = { ...exports, [name]: overflow };
      assert.throws(() => use(handle), refused("PANIC", /stack/), name);
      assert.throws(() => handle.count, refused("PANIC", /an earlier fault/), name);
    }
    // The arguments of the failing call need more memory than there was: the former is not freed any more.
    const handle = (await load({ simd128 })).createScene();
    const { exports } = handle.wasm;
    handle.wasm.exports = { ...exports, vis_scene_insert_batch: trap, vis_free: assert.fail };
    assert.throws(
      () => handle.insertAll({ bounds: new Float64Array(6000) }),
      refused("PANIC", /unreachable/),
    );
  });

  test(say("indices are read where they are, and memory does not grow with frames"), () => {
    const scene = visibility.createScene();
    const bounds = Array.from({ length: 5000 }, (_, i) => [
      5 + (i % 50),
      i / 5000,
      0,
      6 + (i % 50),
      1,
      1,
    ]).flat();
    scene.insertAll({ bounds });
    const [view, visible] = [visibility.createView(), visibility.createVisible()];
    const pipeline = visibility.createPipeline().addFrustum();
    view.setPerspective(CAMERA);
    pipeline.cull(scene, view, visible);
    assert.equal(visible.indices.length, 5000);
    assert.equal(visible.indices.buffer, visibility.memory.buffer);
    const { byteLength } = visibility.memory.buffer;
    for (let frame = 0; frame < 2000; frame++) {
      view.setPerspective({ ...CAMERA, target: [1, Math.sin(frame), 0] });
      pipeline.cull(scene, view, visible);
      assert.equal(visible.indices.length, visible.count);
    }
    assert.equal(visibility.memory.buffer.byteLength, byteLength);
  });
}

test("the README's program runs", async () => {
  const readme = await readFile(new URL("../README.md", import.meta.url), "utf8");
  const [, program] = readme.match(/^```js\n([\s\S]*?)^```$/m);
  const lines = [];
  const body = program.replace(/^import .*$/m, "");
  const AsyncFunction = (async () => {}).constructor;
  const names = { Depth, Flag, indexOf, load, console: { log: (line) => lines.push(line) } };
  await new AsyncFunction(...Object.keys(names), body)(...Object.values(names));
  assert.deepEqual(lines, ["draw object 0", "object 1 is behind the wall"]);
  const [, plans] = readme.match(/^```js\n(const plan =[\s\S]*?)^```$/m);
  const visibility = await load();
  const scene = visibility.createScene();
  scene.insert({ bounds: WALL });
  const given = { Opacity, visibility, scene, triangles: [4, -9, -9, 4, 9, -9, 4, 9, 9] };
  const both = `${plans}; return { plan, level };`;
  const made = await new AsyncFunction(...Object.keys(given), both)(...Object.values(given));
  assert.deepEqual([made.plan.sees([0, 0], [9, 5]), made.level.bytes.length > 50], [true, true]);

  // Levels of detail, draw lists and mirrors, in a room whose mirror shows the lamp behind the eye.
  const bounds = { min: [-2, -1, -1], max: [-1, 1, 1] };
  const hall = visibility.createScene();
  const lamp = hall.insert({ bounds });
  const wall = hall.insert({ bounds: WALL });
  const [view, visible] = [visibility.createView(), visibility.createVisible()];
  const [mirrored, shown] = [visibility.createView(), visibility.createVisible()];
  view.setPerspective(CAMERA);
  const cells = visibility.createCells(visibility.createGraph(1, []), [{ min: [-9, -9, -9], max: [9, 9, 9] }]);
  const pipeline = visibility.createPipeline().addFrustum();
  const corners = [
    [9, 5, -5],
    [9, -5, -5],
    [9, -5, 5],
    [9, 5, 5],
  ];
  const drawn = [];
  const drawMirror = (matrix, planes, indices) => drawn.push([matrix.length, planes.length, ...indices]);
  const meshes = Array(6).fill([3, 0, 0, 0, 0]).flat();
  const room = { visibility, scene: hall, lamp, wall, view, visible, mirrored, shown, cells, pipeline, corners };
  const [, mirrors] = readme.match(/^```js\n(cells.addMirror[\s\S]*?)^```$/m);
  const [, levels] = readme.match(/^```js\n(\/\/ Once: the sizes[\s\S]*?)^```$/m);
  const [hang, draw] = mirrors.split("// Each frame, after `cull`:\n");
  const all = { ...room, drawMirror, meshes };
  const text = `${hang}; pipeline.cull(scene, view, visible); ${draw}; ${levels}; return { list, indirect };`;
  const { list, indirect } = await new AsyncFunction(...Object.keys(all), text)(...Object.values(all));
  assert.deepEqual(drawn, [[16, 1, indexOf(lamp), indexOf(wall)]]);
  assert.deepEqual([[...list.instances], indirect.length], [[indexOf(wall)], 5]);
});

test("the declaration names what there is", async () => {
  assert.ok(hasSimd128());
  const declaration = await readFile(new URL("../package/visibility.d.ts", import.meta.url), "utf8");
  const source = await readFile(new URL("../package/visibility.js", import.meta.url), "utf8");
  /** By class: its public methods and getters, in order. */
  const members = (text, begin, member) => {
    const classes = [...text.matchAll(begin)].map(({ 1: name, 2: body }) => [name, body]);
    return Object.fromEntries(
      classes.map(([name, body]) => [name, new Set([...body.matchAll(member)].map((m) => m[1]))]),
    );
  };
  const declared = members(
    declaration,
    /^export interface (\w+)[^{]*\{\n([\s\S]*?)^\}/gm,
    /^  (?:readonly )?(\w+)[(:]/gm,
  );
  const there = members(source, /^class (\w+)[^{]*\{\n([\s\S]*?)^\}/gm, /^  (?:get )?(\w+)\(.*\{$/gm);
  for (const [name, made] of Object.entries(there)) {
    if (["Wasm", "Handle"].includes(name)) continue;
    made.delete("constructor");
    if (name === "Visibility") made.add("simd128");
    assert.deepEqual([...made].sort(), [...(declared[name] ?? [])].sort(), name);
  }
});

test("what is no module is refused by its address", async () => {
  for (const text of ["<!doctype html>", ""])
    await assert.rejects(load({ wasm: new URL(`data:text/html,${text}`) }), /text\/html.* is no WebAssembly module/);
  const plain = await readFile(new URL("../package/visibility-frames.wasm", import.meta.url));
  const source = new URL(`data:application/octet-stream;base64,${plain.toString("base64")}`);
  assert.ok((await load({ wasm: source })).createScene());
});
