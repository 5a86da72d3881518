//! Cutting triangles and edges at the near plane, in clip space.

/// Where the side of a triangle crosses the limit beyond the near plane; the ends lie on different sides of it. Always counted from the
/// same end, so
/// that neighbours agree.
#[inline(always)]
pub(crate) fn cut_edge(a: &[f64; 5], b: &[f64; 5], near_limit: f64) -> [f64; 5] {
    let (a, b) = if a[4] < b[4] { (a, b) } else { (b, a) };
    let share = (near_limit - a[4]) / (b[4] - a[4]);
    let mut out = [0.0; 5];
    for i in 0..5 {
        out[i] = a[i] * (1.0 - share) + b[i] * share;
    }
    out
}

/// Corners of a triangle after cutting.
pub(crate) struct ClippedTriangle {
    pub(crate) corners: [[f64; 5]; 4],
    pub(crate) count: usize,
    /// The cut, from where the triangle's sides run out to where they come back.
    pub(crate) edge: Option<[[f64; 5]; 2]>,
}

/// What is left of a triangle beyond the limit.
pub(crate) fn clip_triangle(t: [&[f64; 5]; 3], near_limit: f64) -> ClippedTriangle {
    let mut out = ClippedTriangle { corners: [[0.0; 5]; 4], count: 0, edge: None };
    let mut push = |p: [f64; 5]| {
        if out.count < 4 {
            out.corners[out.count] = p;
            out.count += 1;
        }
    };
    let (mut leaves, mut enters) = (None, None);
    for i in 0..3 {
        let (a, b) = (t[i], t[(i + 1) % 3]);
        if a[4] > near_limit {
            push(*a);
        }
        if (a[4] > near_limit) != (b[4] > near_limit) {
            let p = cut_edge(a, b, near_limit);
            push(p);
            *(if a[4] > near_limit { &mut leaves } else { &mut enters }) = Some(p);
        }
    }
    out.edge = leaves.zip(enters).map(|(a, b)| [a, b]);
    out
}
