//! Tests of the example engine: no step of a frame allocates, and no visible instance is missing.

use visibility_examples::engine::Engine;
use visibility_testing::allocations::ALLOCATIONS;

#[test]
fn no_step_of_a_warm_frame_allocates() {
    let mut engine = Engine::new().unwrap();
    let frame = |engine: &mut Engine| {
        engine.simulate();
        let before = ALLOCATIONS.get();
        engine.move_instances().unwrap();
        engine.maintain();
        engine.cull_eyes();
        engine.select_levels();
        engine.list_draws();
        engine.cull_cascades();
        engine.write_bits().unwrap();
        ALLOCATIONS.get() - before
    };
    for _ in 0..300 {
        frame(&mut engine);
    }
    let counts = engine.counts();
    assert!(counts.visible > 500 && counts.visible < 40_000, "{counts:?}");
    assert!(counts.draws > 100 && counts.draws <= 600 && counts.casters > counts.visible / 4, "{counts:?}");
    let allocations: Vec<usize> = (0..40).map(|_| frame(&mut engine)).collect();
    assert_eq!(allocations, [0; 40], "allocations in 40 warm frames");
}
