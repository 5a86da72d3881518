//! Pareto-optimal points: the points that no other point dominates.

use super::point::Point;

/// Returns the costs that are compared: time per frame, triangles drawn, wrong pixels. A point dominates
/// another if all its costs are less or equal and one is less.
fn costs(point: &Point) -> [f64; 3] {
    [point.frame_us, point.triangles, point.wrong_pixels_percent]
}

/// Returns the indices of the points of one scene that no other point dominates in time, triangles drawn and
/// wrong pixels, by ascending time. Points with equal costs do not dominate each other.
pub fn best(points: &[Point]) -> Vec<usize> {
    let beaten = |point: &Point| {
        let mine = costs(point);
        points.iter().map(costs).any(|other| other.iter().zip(&mine).all(|(a, b)| a <= b) && other != mine)
    };
    let mut best: Vec<usize> = (0..points.len()).filter(|&i| !beaten(&points[i])).collect();
    best.sort_by(|&a, &b| points[a].frame_us.total_cmp(&points[b].frame_us));
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a point with the given time in microseconds, triangles drawn, and percentage of wrong pixels.
    fn point(frame_us: f64, triangles: f64, wrong: f64) -> Point {
        Point {
            scene: String::new(),
            culler: String::new(),
            accuracy: "exact",
            frame_us,
            p99_us: frame_us,
            objects: 0.0,
            visible_objects: 0.0,
            triangles,
            visible_triangles: 1.0,
            false_hidden: 0,
            wrong_pixels_percent: wrong,
            memory_bytes: 0,
            preparation_ms: 0.0,
            box_limit: 0.0,
            over_ideal: 0.0,
        }
    }

    #[test]
    fn beaten_points_are_left_out_and_ties_kept() {
        let points = [
            point(9.0, 1.0, 0.0),
            point(1.0, 9.0, 0.0),
            point(9.0, 2.0, 0.0),
            point(1.0, 9.0, 0.0),
            point(2.0, 2.0, 1.0),
        ];
        assert_eq!(best(&points), [1, 3, 4, 0], "points that are not beaten, by their first value");
        assert!(best(&[]).is_empty(), "no points");
    }
}
