//! Exact arithmetic: a number is a sum of non-overlapping `f64` values (Shewchuk, "Adaptive Precision
//! Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997: two-product and grow-expansion).

use visibility_core::View;
use visibility_core::glam::DVec3;

/// An exact number as the sum of its components, in order of increasing magnitude and without zeros; empty
/// for 0. Exact unless a component overflows or underflows.
#[derive(Clone, Debug, Default)]
pub struct Exact(Vec<f64>);

impl Exact {
    /// Adds the number `q` to this one, exactly.
    fn add(&mut self, mut q: f64) {
        let mut kept = 0;
        for i in 0..self.0.len() {
            let h = self.0[i];
            let sum = q + h;
            let other = sum - q;
            let rest = (q - (sum - other)) + (h - other);
            q = sum;
            if rest != 0.0 {
                self.0[kept] = rest;
                kept += 1;
            }
        }
        self.0.truncate(kept);
        if q != 0.0 {
            self.0.push(q);
        }
    }

    /// Adds the product `a b` to this number, exactly.
    fn add_product(&mut self, a: f64, b: f64) {
        let high = a * b;
        self.add(a.mul_add(b, -high));
        self.add(high);
    }

    /// Returns this number minus `other`, exactly.
    pub fn minus(&self, other: &Self) -> Self {
        let mut all = self.clone();
        other.0.iter().for_each(|&x| all.add(-x));
        all
    }

    /// Returns the product of this number and `other`, exactly.
    pub fn times(&self, other: &Self) -> Self {
        let mut all = Self::default();
        for &a in &self.0 {
            for &b in &other.0 {
                all.add_product(a, b);
            }
        }
        all
    }

    /// Returns the sign of the number: 1, 0 or -1.
    pub fn sign(&self) -> i32 {
        self.0.last().map_or(0, |&x| if x > 0.0 { 1 } else { -1 })
    }
}

/// Returns exact clip-space x, y and w of a point in world coordinates, by the elements of the view's matrix.
pub fn clip(view: &View, p: DVec3) -> [Exact; 3] {
    let (matrix, origin) = (view.clip_from(view.origin()), view.origin());
    [0, 1, 3].map(|row| {
        let r = matrix.row(row);
        let mut sum = Exact::default();
        sum.add(r.w);
        for i in 0..3 {
            sum.add_product(r[i], p[i]);
            sum.add_product(-r[i], origin[i]);
        }
        sum
    })
}

/// Returns the sign of the determinant of three directions: the side of the plane through the eye, `a` and
/// `b` on which `c` lies. 0 on the plane.
pub fn side(a: &[Exact; 3], b: &[Exact; 3], c: &[Exact; 3]) -> i32 {
    let mut sum = Exact::default();
    for (i, last) in c.iter().enumerate() {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let minor = a[j].times(&b[k]).minus(&a[k].times(&b[j]));
        let part = minor.times(last);
        part.0.iter().for_each(|&x| sum.add(x));
    }
    sum.sign()
}

/// The exact cone of view rays through a triangle.
pub struct Cone {
    /// Exact clip-space (x, y, w) of the triangle's corners.
    corners: [[Exact; 3]; 3],
    /// Sign (1 or -1) of the determinant of the three corners, which tells their orientation in the image; 0
    /// for a triangle seen edge on.
    turn: i32,
}

impl Cone {
    /// Creates the cone of a triangle given in world coordinates.
    pub fn new(view: &View, triangle: [DVec3; 3]) -> Self {
        let corners = triangle.map(|p| clip(view, p));
        let turn = side(&corners[0], &corners[1], &corners[2]);
        Self { corners, turn }
    }

    /// Tests whether a clip-space (x, y, w) direction is inside the cone or on its boundary. True for every
    /// direction if the triangle is seen edge on.
    pub fn holds(&self, p: &[Exact; 3]) -> bool {
        let [a, b, c] = &self.corners;
        [(a, b), (b, c), (c, a)].iter().all(|(s, e)| side(s, e, p) * self.turn >= 0)
    }
}
