//! Objects divided into pieces of few triangles, each of which then counts as an object: so sets of visible
//! clusters or triangles come from the same programs as sets of visible objects.

use crate::SourceObject;
use glam::Vec3;

type Triangle = [Vec3; 3];

/// Passes the pieces of an object on, each of at most `most` triangles (0 counts as 1), in an order that
/// depends on the triangles alone. The triangles of a piece keep their order. An object of at most `most`
/// triangles is passed on unchanged, and so is one that animations move: its triangles may be anywhere within
/// its bounds.
///
/// The triangles are halved at the median of their centres, along the longest axis of the box around the
/// centres. Pieces keep the name and the flags of the object, and have triangles of their own, also where the
/// object shares a mesh.
pub fn divide(object: SourceObject, most: usize, each: &mut dyn FnMut(SourceObject)) {
    let most = most.max(1);
    if object.triangles.len() <= most || object.motion.is_some() {
        return each(object);
    }
    let triangles: Vec<Triangle> = object.triangles.view().iter().collect();
    let mut waiting = vec![(0..triangles.len() as u32).collect::<Vec<u32>>()];
    while let Some(mut part) = waiting.pop() {
        if part.len() <= most {
            part.sort_unstable();
            let piece: Vec<Triangle> = part.iter().map(|&i| triangles[i as usize]).collect();
            each(SourceObject { triangles: piece.into(), ..object.clone() });
            continue;
        }
        let center = |i: u32| triangles[i as usize].iter().sum::<Vec3>();
        let (low, high) = part
            .iter()
            .map(|&i| center(i))
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let axis = (high - low).max_position();
        // A multiple of `most` in the first half, so that few pieces are smaller than they may be.
        let middle = (part.len() / 2).next_multiple_of(most).min(part.len() - 1);
        part.select_nth_unstable_by(middle, |&a, &b| {
            center(a)[axis].total_cmp(&center(b)[axis]).then(a.cmp(&b))
        });
        let second = part.split_off(middle);
        waiting.push(second);
        waiting.push(part);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    #[test]
    fn pieces_have_each_triangle_once_and_are_compact() {
        let mut random = Random(3);
        for count in [1usize, 2, 63, 64, 65, 128, 1000] {
            let triangle = |random: &mut Random| {
                let corner = random.vector(100.0).as_vec3();
                [corner, corner + Vec3::X, corner + Vec3::Y]
            };
            let all: Vec<Triangle> = (0..count).map(|_| triangle(&mut random)).collect();
            for most in [0, 1, 7, 64] {
                let object = SourceObject { door: true, ..SourceObject::new("door", all.clone()) };
                let mut pieces = Vec::new();
                divide(object, most, &mut |piece| pieces.push(piece));
                let most = most.max(1);
                assert!(
                    pieces.iter().all(|piece| piece.door && piece.name.to_string() == "door"),
                    "{count}: flags"
                );
                assert!(
                    pieces.iter().all(|piece| (1..=most).contains(&piece.triangles.len())),
                    "{count} triangles in pieces of {most}: too many in a piece, or none"
                );
                assert!(
                    pieces.len() <= count.div_ceil(most) + 1,
                    "{count} triangles in {} pieces",
                    pieces.len()
                );
                let sorted = |mut list: Vec<Triangle>| {
                    list.sort_by_key(|t| t.map(|p| p.to_array().map(f32::to_bits)));
                    list
                };
                let of_pieces =
                    pieces.iter().flat_map(|piece| piece.triangles.view().iter().collect::<Vec<_>>());
                assert_eq!(sorted(of_pieces.collect()), sorted(all.clone()), "{count} triangles by {most}");
            }
            // Pieces of a cloud of points are smaller than the cloud.
            let volume = |object: &SourceObject| {
                let bounds = object.triangles.bounds();
                (bounds.max - bounds.min).element_product()
            };
            let whole = SourceObject::new("cloud", all);
            let mut sum = 0.0;
            divide(whole.clone(), 7, &mut |piece| sum += volume(&piece));
            assert!(count < 1000 || sum < 0.7 * volume(&whole), "volumes of the pieces: {sum}");
        }
    }

    #[test]
    fn objects_that_move_stay_whole() {
        let triangles = vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 9];
        let motion = Some(Box::new((Vec3::ZERO, Vec3::ONE)));
        let object = SourceObject { motion, ..SourceObject::new("lift", triangles) };
        let mut pieces = Vec::new();
        divide(object.clone(), 1, &mut |piece| pieces.push(piece));
        assert_eq!(pieces, [object], "the object itself");
    }
}
