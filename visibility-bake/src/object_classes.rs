//! Classes of objects that are seen from the same viewcells, and their encoding in the file of a
//! [`BakedSet`](crate::BakedSet).

use std::collections::HashMap;
use visibility_core::binary_format::{push_number, take_number};

/// [`tour`] compares a column with at most this many columns on either side of it in the list, to find the
/// most similar one.
const TRIED: usize = 128;

/// Approximate limit on the work of [`tour`], in compared pairs of 64-bit words. If there are many or long
/// columns, each is compared with fewer than [`TRIED`] on either side, but with at least one.
const WORK: usize = 1 << 31;

/// Greatest number of 64-bit words of the bit table of [`tour`]: 64 MiB. The table has one bit for each pair
/// of a row and a column. A larger table is not made, and the columns keep their order.
const MAX_WORDS: usize = 1 << 23;

/// Sorts objects that are in the same rows into classes. Returns the objects of each class, and the rows as
/// lists of classes. Time is linear in the lengths of the rows, plus the sorting of classes.
pub(crate) fn classes<R: AsRef<[u32]>>(rows: &[R], index_limit: usize) -> (Vec<Vec<u32>>, Vec<Vec<u32>>) {
    // Each row splits the classes of its objects: objects in the row become new classes. Class 0 is in no
    // row.
    let (mut class_of, mut count) = (vec![0u32; index_limit], 1u32);
    let mut parts = HashMap::new();
    for row in rows {
        parts.clear();
        for &index in row.as_ref() {
            let class = &mut class_of[index as usize];
            *class = *parts.entry(*class).or_insert_with(|| {
                count += 1;
                count - 1
            });
        }
    }
    // For each class, the rows that it is in. Sorting by these lists puts similar classes close together.
    let mut columns: Vec<(Vec<u32>, u32)> = (0..count).map(|class| (Vec::new(), class)).collect();
    for (number, row) in (0..).zip(rows) {
        for &index in row.as_ref() {
            let column = &mut columns[class_of[index as usize] as usize].0;
            if column.last() != Some(&number) {
                column.push(number);
            }
        }
    }
    columns.retain(|(column, _)| !column.is_empty());
    columns.sort_unstable();
    let columns = tour(columns, rows.len());
    let mut number_of = vec![None; count as usize];
    let mut by_class = vec![Vec::new(); rows.len()];
    for (number, (column, class)) in (0..).zip(&columns) {
        number_of[*class as usize] = Some(number as usize);
        column.iter().for_each(|&row| by_class[row as usize].push(number));
    }
    let mut classes = vec![Vec::new(); columns.len()];
    for (index, &class) in (0..).zip(&class_of) {
        if let Some(number) = number_of[class as usize] {
            classes[number].push(index);
        }
    }
    (classes, by_class)
}

/// Orders columns so that similar ones are consecutive. A column is a class: the numbers of the rows that
/// contain the class, and the class's number. The next column is the most similar one of at most [`TRIED`]
/// columns before and after the last one in the list, without those that are ordered already. Time is linear
/// in the numbers of columns and rows, times the number of columns tried, which is less if there are many. If
/// the bits of all columns take more than [`MAX_WORDS`], the order stays.
fn tour(columns: Vec<(Vec<u32>, u32)>, row_count: usize) -> Vec<(Vec<u32>, u32)> {
    let (count, words) = (columns.len(), row_count.div_ceil(64));
    if count.saturating_mul(words) > MAX_WORDS {
        return columns;
    }
    let tried = (WORK / count.saturating_mul(words).max(1)).clamp(1, TRIED);
    let mut bits = vec![0u64; count * words];
    for (bits, (column, _)) in bits.chunks_exact_mut(words.max(1)).zip(&columns) {
        column.iter().for_each(|&row| bits[row as usize / 64] |= 1 << (row % 64));
    }
    let bits = |at: usize| &bits[at * words..(at + 1) * words];
    // The columns that are not ordered yet form a linked list.
    let mut next: Vec<Option<usize>> = (0..count).map(|at| Some(at + 1).filter(|&at| at < count)).collect();
    let mut before: Vec<Option<usize>> = (0..count).map(|at| at.checked_sub(1)).collect();
    let mut order = Vec::with_capacity(count);
    let mut last = (count > 0).then_some(0);
    while let Some(at) = last {
        order.push(at);
        if let Some(next) = next[at] {
            before[next] = before[at];
        }
        if let Some(before) = before[at] {
            next[before] = next[at];
        }
        let distance = |other: usize| -> u32 {
            bits(at).iter().zip(bits(other)).map(|(a, b)| (a ^ b).count_ones()).sum()
        };
        let links = [&before, &next];
        let near =
            links.into_iter().flat_map(|link| std::iter::successors(link[at], |&at| link[at]).take(tried));
        last = near.min_by_key(|&other| (distance(other), other));
    }
    let mut columns: Vec<Option<(Vec<u32>, u32)>> = columns.into_iter().map(Some).collect();
    order.into_iter().filter_map(|at| columns[at].take()).collect()
}

/// Encodes classes as one number for each object: the step from the object before it in the class, times 2,
/// plus 1 if the class has further objects. For the first object of a class, the step is taken from the first
/// object of the class before, and encoded by [`signed_code`].
pub(crate) fn class_bytes(classes: &[Vec<u32>]) -> Vec<u8> {
    let (mut bytes, mut first) = (Vec::new(), 0u32);
    for class in classes {
        let mut next = None;
        for (at, &index) in class.iter().enumerate() {
            let number = match next {
                Some(next) => u64::from(index - next),
                None => signed_code(i64::from(index) - i64::from(first)),
            };
            let code = number * 2 + u64::from(at + 1 < class.len());
            // Indices are less than half of the greatest number, since sets of more objects are refused.
            push_number(code as u32, &mut bytes);
            next = Some(index + 1);
        }
        first = class.first().copied().unwrap_or(first);
    }
    bytes
}

/// Maps the numbers 0, -1, 1, -2, 2 and so on to 0, 1, 2, 3, 4 and so on.
fn signed_code(number: i64) -> u64 {
    if number < 0 { number.unsigned_abs() * 2 - 1 } else { number.unsigned_abs() * 2 }
}

/// Calls `each` with the class and the index of each object, class by class, in bytes that [`class_bytes`]
/// has written. Returns the number of classes. `None` if an index is not below `limit`, or if the bytes end
/// within a class.
pub(crate) fn for_each_in_classes(
    bytes: &[u8],
    limit: usize,
    mut each: impl FnMut(usize, u32),
) -> Option<usize> {
    let (mut rest, mut first, mut count) = (bytes, 0u32, 0);
    while !rest.is_empty() {
        let code = take_number(&mut rest)?;
        let (number, mut has_more) = (code / 2, code % 2 == 1);
        let step = if number % 2 == 1 { -i64::from(number / 2) - 1 } else { i64::from(number / 2) };
        first = u32::try_from(i64::from(first) + step).ok().filter(|&index| (index as usize) < limit)?;
        each(count, first);
        let mut last = first;
        while has_more {
            let code = take_number(&mut rest)?;
            has_more = code % 2 == 1;
            last = last.checked_add(1)?.checked_add(code / 2).filter(|&index| (index as usize) < limit)?;
            each(count, last);
        }
        count += 1;
    }
    Some(count)
}

/// Checks bytes that [`class_bytes`] has written, and returns the number of classes. `None` if an object is
/// in two classes, if an index is not below `limit`, or if the bytes end within a class.
pub(crate) fn count_classes(bytes: &[u8], limit: usize) -> Option<usize> {
    let mut all = Vec::new();
    let count = for_each_in_classes(bytes, limit, |_, index| all.push(index))?;
    all.sort_unstable();
    all.windows(2).all(|pair| pair[0] < pair[1]).then_some(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_in_the_same_rows_are_a_class() {
        let rows = [vec![1, 2, 7], vec![1, 2], vec![0, 7], vec![]];
        let (classes, by_class) = classes(&rows, 9);
        assert_eq!(
            classes,
            [vec![1, 2], vec![7], vec![0]],
            "objects by class, classes in the order of their first rows"
        );
        assert_eq!(by_class, [vec![0, 1], vec![0], vec![1, 2], vec![]], "classes by row");
        let mut read = vec![Vec::new(); 3];
        let bytes = class_bytes(&classes);
        assert_eq!(
            for_each_in_classes(&bytes, 9, |class, index| read[class].push(index)),
            Some(3),
            "classes read from bytes"
        );
        assert_eq!(
            (read, count_classes(&bytes, 9)),
            (classes, Some(3)),
            "objects read by class, and classes counted"
        );
    }

    #[test]
    fn classes_that_make_no_sense_are_refused() {
        let read = |classes: &[&[u32]]| {
            count_classes(&class_bytes(&classes.iter().map(|class| class.to_vec()).collect::<Vec<_>>()), 400)
        };
        assert!(read(&[&[1, 2, 300], &[399]]).is_some(), "classes of known objects, each once");
        assert_eq!(read(&[&[1, 2, 300], &[400]]), None, "unknown");
        assert_eq!(read(&[&[1, 2, 300], &[0, 2]]), None, "twice");
        for cut_off in
            [&[5][..], &[4, 0x80], &[0x80], &[1, 0xff, 0xff, 0xff, 0xff, 0x8f], &[2], &[5, 0x80, 0]]
        {
            assert_eq!(count_classes(cut_off, 400), None, "{cut_off:?}");
        }
    }

    #[test]
    fn no_later_object_of_a_class_is_beyond_the_limit() {
        let bytes = class_bytes(&[vec![3, 9]]);
        assert_eq!([10, 9].map(|limit| count_classes(&bytes, limit)), [Some(1), None], "an object 9");
        let same = class_bytes(&[vec![3], vec![3]]);
        assert_eq!(count_classes(&same, 9), None, "an object in two classes");
    }

    /// Random rows come back from their classes, whatever the order of the classes.
    #[test]
    fn rows_are_those_of_their_classes() {
        let mut random = visibility_testing::Random(3);
        for round in 0..40 {
            let rows: Vec<Vec<u32>> =
                (0..random.below(90)).map(|_| (0..30).filter(|_| random.one_in(3)).collect()).collect();
            let (classes, by_class) = classes(&rows, 30);
            for (row, of) in rows.iter().zip(&by_class) {
                let mut found: Vec<u32> =
                    of.iter().flat_map(|&class| classes[class as usize].iter().copied()).collect();
                found.sort_unstable();
                assert_eq!(&found, row, "round {round}: a row from its classes");
                assert!(of.is_sorted(), "round {round}: classes of a row ascend");
            }
        }
    }
}
