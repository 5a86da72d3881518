struct Camera {
    // From coordinates of the scene to clip space. Depth is 1 at the near plane and 0 at infinity.
    clip_from_scene: mat4x4<f32>,
    // Size of the picture in pixels.
    size: vec2<f32>,
    // Half the width of a pixel in metres, per unit of clip-space w.
    half_pixel: f32,
    unused: f32,
};
