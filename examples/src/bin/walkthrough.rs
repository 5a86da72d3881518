//! Walks a camera through a scene and culls every frame.
fn main() {}
