use super::*;
use crate::binary_format::HEADER_LENGTH;
use alloc::string::ToString;
use alloc::vec;
use proptest::prelude::*;

/// Returns a PVS of four viewcells, the last stored as a difference.
fn sample() -> Pvs {
    let rows = [vec![5, 6, 7, 300, 302], vec![], (0..400).filter(|x| x % 3 == 0).collect::<Vec<u32>>()];
    let mut rows = rows.to_vec();
    rows.push(rows[2].iter().copied().filter(|&x| x != 33).collect());
    Pvs::new(PvsTargets::Cells, 400, &rows, |cell| (0..cell.0).map(ViewcellId).collect::<Vec<_>>()).unwrap()
}

/// Returns the bytes with a corrected length and checksum.
fn resealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let content = bytes.split_off(HEADER_LENGTH);
    let number = |place: usize| u32::from_le_bytes(bytes[place..place + 4].try_into().unwrap());
    let format = Format { version: number(8), ..FORMAT };
    let counts = u64::from(number(16)) | u64::from(number(20)) << 32;
    let mut writer = Writer::new(format, number(12), counts);
    writer.bytes(&content);
    writer.finish()
}

#[test]
fn rows_next_to_each_other_are_stored_as_differences() {
    let pvs = sample();
    // Four bytes follow the count: form 1 (a difference), from one viewcell back, a run of 33 absent targets,
    // a run of one present target.
    assert!(pvs.bytes.ends_with(&[4, 1, 1, 33, 1]), "the last row is stored as a difference");
    assert!(
        !pvs.sees(ViewcellId(3), 33) && pvs.sees(ViewcellId(2), 33) && pvs.sees(ViewcellId(3), 36),
        "targets 33 and 36 differ between viewcells 2 and 3"
    );
    assert_eq!(
        (pvs.targets(), pvs.viewcell_count(), pvs.target_count()),
        (PvsTargets::Cells, 4, 400),
        "what the set was made with"
    );
}

#[test]
fn the_form_of_a_stored_set_stays() {
    let rows = [vec![1, 2, 4, 6, 8, 10], vec![1, 2, 4, 6, 8, 10, 299]];
    let pvs = Pvs::new(PvsTargets::Objects, 300, &rows, |id| [ViewcellId(id.0 / 2)]).unwrap();
    let stored = |content: &[u8]| {
        let counts = [&[2, 0, 0, 0, 44, 1, 0, 0][..], &[40 + content.len() as u8, 0, 0, 0, 0, 0, 0, 0]];
        let mut bytes = [b"VISI-PVS", &[4, 0, 0, 0, 1, 0, 0, 0][..], &counts.concat()].concat();
        let all = bytes.iter().chain(content);
        let sum = all
            .fold(0xcbf2_9ce4_8422_2325_u64, |sum, &b| (sum ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
        bytes.extend(sum.to_le_bytes());
        bytes.extend(content);
        bytes
    };
    // Row 0 as bits, then row 1 as its difference from row 0, in runs: 299 absent targets, one present.
    let short = [&[0, 0, 0, 0, 10, 0, 0, 0][..], &[3, 2, 0x56, 5], &[5, 1, 1, 0xab, 2, 1]];
    assert_eq!(
        pvs.as_bytes(),
        stored(&short.concat()),
        "the bytes that version 4 has written since it exists"
    );
    // Row 0 as runs (one absent target, two present, and so on), then row 1 as its difference from row 0, in
    // bits.
    let long =
        [&[0, 0, 0, 0, 53, 0, 0, 0][..], &[11, 0, 1, 2, 1, 1, 1, 1, 1, 1, 1, 1], &[40, 3, 1], &[0; 37], &[8]];
    let long = Pvs::from_bytes(stored(&long.concat())).unwrap();
    for target in 0..300 {
        for (number, row) in (0..).zip(&rows) {
            assert_eq!(long.sees(ViewcellId(number), target), row.contains(&target), "{number} {target}");
        }
    }
}

#[test]
fn every_damaged_byte_is_noticed() {
    let good = sample().bytes;
    for i in 0..good.len() {
        for flip in [1, 0x80] {
            let mut bytes = good.clone();
            bytes[i] ^= flip;
            assert!(Pvs::from_bytes(bytes).is_err(), "byte {i}");
        }
        assert!(Pvs::from_bytes(&good[..i]).is_err(), "the first {i} bytes of {}", good.len());
    }
    let mut longer = good.clone();
    longer.push(0);
    let error = Pvs::from_bytes(longer).unwrap_err();
    assert_eq!(
        error.to_string(),
        alloc::format!("{} bytes, where {} are expected", good.len() + 1, good.len()),
        "the error says both lengths"
    );
}

#[test]
fn wrong_rows_with_a_right_checksum_are_refused_and_say_why() {
    let good = sample().bytes;
    let rows = HEADER_LENGTH + 2 * 4;
    let wrong = |place: usize, byte: u8| {
        let mut bytes = good.clone();
        bytes[place] = byte;
        Pvs::from_bytes(resealed(bytes)).unwrap_err().to_string()
    };
    let last = good.len() - 1;
    assert_eq!(
        wrong(8, 3),
        "version 3 of the format, where only version 4 is known: bake again",
        "an older version"
    );
    assert_eq!(
        wrong(8, 5),
        "version 5 of the format, where only version 4 is known: it is of a later release",
        "a later version"
    );
    assert_eq!(
        wrong(12, 7),
        "at byte 40: the targets are neither cells nor objects",
        "an unknown kind of targets"
    );
    assert_eq!(
        wrong(rows + 1, 9),
        "the row of viewcell 0: it has no known form",
        "a row that begins with an unknown form"
    );
    let number = "a number is cut off, too large or longer than it need be";
    assert_eq!(
        wrong(last, 0x81),
        alloc::format!("the row of viewcell 3: {number}"),
        "the last number of the last row goes on after its end"
    );
    for back in [0, 4, 9] {
        assert_eq!(
            wrong(last - 2, back),
            "the row of viewcell 3: it has no known form",
            "a difference from {back} rows back"
        );
    }
    assert_eq!(
        wrong(last - 4, 5),
        "the row of viewcell 3: it lies outside the rows",
        "a length of more bytes than there are"
    );
    assert_eq!(
        wrong(20, 99),
        "the row of viewcell 2: it names an unknown target",
        "a target number beyond the last target"
    );
    assert_eq!(
        wrong(HEADER_LENGTH + 7, 0xff),
        "the row of viewcell 0: it lies outside the rows",
        "a row that begins after the end"
    );
}

#[test]
fn a_source_is_stored_after_the_rows_and_changes_none() {
    for pvs in [sample(), Pvs::new(PvsTargets::Cells, 0, &[[0; 0]; 0], |_| []).unwrap()] {
        assert_eq!(pvs.source(), None, "a set without a source");
        let with = pvs.clone().with_source(u64::MAX - 6);
        assert_eq!(with.source(), Some(u64::MAX - 6), "the source that was set");
        assert!(with.stamp() != pvs.stamp(), "a set with a source has other content");
        let loaded = Pvs::from_bytes(with.as_bytes()).unwrap();
        assert_eq!((loaded.source(), &loaded), (with.source(), &with), "the source survives being stored");
        assert_eq!(
            loaded.clone().with_source(0).as_bytes().len(),
            with.as_bytes().len(),
            "a second source takes the place of the first"
        );
        assert_eq!(loaded.with_source(0).source(), Some(0), "zero is a source like any other");
        for number in 0..5 {
            let [mut a, mut b] = [Vec::new(), Vec::new()];
            pvs.write_bits(ViewcellId(number), &mut a);
            with.write_bits(ViewcellId(number), &mut b);
            assert_eq!(a, b, "viewcell {number}: the row does not depend on the source");
        }
        for more in [1, 7, 9, 16] {
            let longer = [pvs.as_bytes(), &vec![0; more]].concat();
            let said = Pvs::from_bytes(resealed(longer)).unwrap_err().to_string();
            assert!(said.ends_with("neither the end nor a source follows the last row"), "{said}");
        }
    }
}

#[test]
fn rows_differ_from_rows_that_differ_up_to_a_depth() {
    // Each row has one target more than the row before.
    let rows: Vec<Vec<u32>> =
        (0..40).map(|row| (0..350).filter(|x| x % 7 < 3 || x / 7 < row).collect()).collect();
    let before = |cell: ViewcellId| cell.0.checked_sub(1).map(ViewcellId);
    let pvs = Pvs::new(PvsTargets::Objects, 350, &rows, before).unwrap();
    let loaded = Pvs::from_bytes(pvs.as_bytes()).unwrap();
    let mut words = Vec::new();
    for (number, row) in (0..).zip(&rows) {
        loaded.write_bits(ViewcellId(number), &mut words);
        assert!(
            (0..350).all(|x| (words[x as usize / 64] >> (x % 64) & 1 == 1) == row.contains(&x)),
            "{number}"
        );
    }
    // Eight rows stored by themselves as bits, 44 bytes each, and 32 rows stored as differences.
    assert!(pvs.bytes.len() < HEADER_LENGTH + 4 * 4 + 8 * 47 + 32 * 7, "{}", pvs.bytes.len());

    // Row 0 has target 0; each later row differs from the one before by one target.
    let chain = |length: u8| {
        let mut writer = Writer::new(FORMAT, 1, u64::from(length) | 400 << 32);
        writer.u32s([0, 4 + 5 * (u32::from(length) - 1)]);
        writer.bytes(&[3, 0, 0, 1]);
        (1..length).for_each(|row| writer.bytes(&[4, 1, 1, row, 1]));
        Pvs::from_bytes(writer.finish())
    };
    let deepest = chain(5).unwrap();
    assert!(
        (0..5).all(|target| deepest.sees(ViewcellId(4), target)) && !deepest.sees(ViewcellId(3), 4),
        "a chain of four differences is read to its beginning"
    );
    assert_eq!(
        chain(6).unwrap_err().to_string(),
        "the row of viewcell 5: it takes too many other rows",
        "a chain of five differences is one too many"
    );
}

#[test]
fn a_row_of_one_great_target_takes_little_memory() {
    let great = u32::MAX - 1;
    let pvs = Pvs::new(PvsTargets::Objects, u32::MAX as usize, &[vec![7], vec![great]], |_| [ViewcellId(0)]);
    assert!(pvs.unwrap().sees(ViewcellId(1), great), "the greatest target there is");
    let mut bits = Vec::new();
    assert!(!write_bits([7, great].into_iter(), 6, &mut bits), "the last bit is beyond the limit");
    assert!(bits.capacity() < 64, "{} bytes for nothing", bits.capacity());
    bits.clear();
    assert!(!write_bits([7].into_iter(), 1, &mut bits), "as long as the limit");
    assert!(write_bits([7].into_iter(), 2, &mut bits), "one byte less than the limit");
}

/// Rows with every range of targets, and rows with every range left out, stored as runs and as bits: covers
/// all borders of bytes and words.
#[test]
fn ranges_are_read_as_they_were_written() {
    const COUNT: u32 = 130;
    for step in [1, 2] {
        let mut rows = Vec::new();
        for (start, end) in (0..COUNT).flat_map(|start| (start..=COUNT).map(move |end| (start, end))) {
            // With step 2, every second target of the range, the row is stored as bits.
            let is_in = |x: &u32| (start..end).contains(x) && (x - start).is_multiple_of(step);
            rows.push((0..COUNT).filter(is_in).collect::<Vec<u32>>());
            rows.push((0..COUNT).filter(|x| !is_in(x)).collect());
        }
        let pvs = Pvs::new(PvsTargets::Cells, COUNT as usize, &rows, |_| []).unwrap();
        let mut words = Vec::new();
        for (row, viewcell) in rows.iter().zip((0..).map(ViewcellId)) {
            assert!(pvs.write_bits(viewcell, &mut words), "{viewcell:?} is in the set");
            let mut expected = vec![0u64; 3];
            row.iter().for_each(|x| expected[*x as usize / 64] |= 1 << (x % 64));
            assert_eq!(words, expected, "{row:?}");
            let targets =
                row.first().into_iter().chain(row.last()).flat_map(|&x| [x.saturating_sub(1), x, x + 1]);
            for target in targets {
                assert_eq!(pvs.sees(viewcell, target), row.contains(&target), "{target} of {row:?}");
            }
        }
    }
}

#[test]
fn several_viewcells_see_what_any_of_them_sees() {
    let pvs = sample();
    let (mut words, mut row) = (vec![7; 99], Vec::new());
    let all = [0, 1, 2, 3, 4].map(ViewcellId);
    for set in 0..32u32 {
        let some: Vec<ViewcellId> = all.into_iter().filter(|id| set >> id.0 & 1 != 0).collect();
        pvs.write_union(&some, &mut words, &mut row);
        assert_eq!(words.len(), 400usize.div_ceil(64), "one bit per target, in words of 64");
        for target in 0..400u32 {
            // There is no row 4: an unknown viewcell sees all targets.
            let sees = |&id: &ViewcellId| id.0 == 4 || pvs.sees(id, target);
            assert_eq!(
                words[target as usize / 64] >> (target % 64) & 1 != 0,
                some.iter().any(sees),
                "{set} {target}"
            );
        }
        assert_eq!(words[6] >> (400 % 64), 0, "no bit of no target");
    }
}

/// What follows the last row, here a source, is no row, although the offsets of blocks can be read so that
/// they lead there.
#[test]
fn a_viewcell_after_the_last_one_has_no_row() {
    let bits = |count: u32| (0..4 * count).map(|x| 2 * x).collect::<Vec<u32>>();
    let mut rows = vec![vec![16, 18, 20, 22], vec![0, 2]];
    rows.extend(vec![bits(34); 14]);
    let pvs = Pvs::new(PvsTargets::Objects, 300, &rows, |_| []).unwrap();
    // The second offset of a block after the last one is the first row, 4, 2, 0, 0: byte 516 of the rows.
    assert_eq!(pvs.rows_end(), HEADER_LENGTH + 2 * 4 + 512, "the end of the rows");
    assert_eq!(pvs.word(HEADER_LENGTH + 2 * 4), 516, "the first bytes of the rows");
    // Three bytes follow: a form, 0 absent targets and 100 present ones.
    let pvs = pvs.with_source(u64::from_le_bytes([3, 0, 0, 100, 0, 0, 0, 0]));
    let (mut words, mut row) = (Vec::new(), Vec::new());
    assert!(!pvs.write_bits(ViewcellId(16), &mut words), "an unknown viewcell");
    assert!(words.iter().all(|&word| word == 0) && !pvs.sees(ViewcellId(16), 50), "{words:?} seen");
    pvs.write_union(&[ViewcellId(16)], &mut words, &mut row);
    let count: u32 = words.iter().map(|word| word.count_ones()).sum();
    assert_eq!(count, 300, "an unknown viewcell sees all targets in a union");
}

#[test]
fn only_rows_before_a_row_are_its_bases() {
    let rows: Vec<Vec<u32>> =
        (0..9).map(|row| (0..300).filter(|x| x % 9 < 4 || *x == row).collect()).collect();
    let new = |neighbours: &dyn Fn(u32) -> Vec<u32>| {
        let bases = |cell: ViewcellId| neighbours(cell.0).into_iter().map(ViewcellId);
        Pvs::new(PvsTargets::Cells, 300, &rows, bases).unwrap()
    };
    let alone = new(&|_| vec![]);
    assert_eq!(new(&|row| vec![row]), alone, "a row as its own base");
    assert_eq!(new(&|row| (row..9).collect()), alone, "rows after the row as its bases");
    assert!(
        new(&|row| (0..row).collect()).bytes.len() < alone.bytes.len(),
        "rows before the row as its bases"
    );
}

#[test]
fn more_targets_than_can_be_numbered_are_refused() {
    let new =
        |count| Pvs::new(PvsTargets::Objects, count, &[[0; 0]; 0], |_| []).map(|pvs| pvs.target_count());
    let most = u32::MAX as usize;
    assert_eq!(
        [new(most), new(most + 1)],
        [Ok(most), Err(PvsError::Size)],
        "the greatest number, and one more"
    );
}

#[test]
fn rows_that_make_no_sense_are_not_taken() {
    let new = |row: &[u32]| Pvs::new(PvsTargets::Cells, 9, &[row], |_| []).unwrap_err();
    assert_eq!(new(&[3, 3]), PvsError::Target { viewcell: ViewcellId(0), target: 3 }, "a target named twice");
    assert_eq!(
        new(&[3, 9]),
        PvsError::Target { viewcell: ViewcellId(0), target: 9 },
        "a target beyond the last"
    );
}

proptest! {
    #[test]
    fn what_was_stored_is_what_is_seen(
        rows in prop::collection::vec(prop::collection::vec(prop::bool::weighted(0.6), 150), 0..9)
    ) {
        let rows: Vec<Vec<u32>> =
            rows.iter().map(|row| (0..).zip(row).filter(|(_, seen)| **seen).map(|(i, _)| i).collect()).collect();
        let pvs = Pvs::new(PvsTargets::Objects, 150, &rows, |cell| cell.0.checked_sub(1).map(ViewcellId)).unwrap();
        let pvs = Pvs::from_bytes(pvs.as_bytes()).unwrap();
        let mut bits = Vec::new();
        for viewcell in 0..rows.len() + 1 {
            let row = rows.get(viewcell).cloned().unwrap_or_default();
            let viewcell = ViewcellId(viewcell as u32);
            prop_assert_eq!(pvs.write_bits(viewcell, &mut bits), viewcell.index() < rows.len());
            for target in 0..160 {
                let bit = bits.get(target as usize / 64).is_some_and(|word| word >> (target % 64) & 1 != 0);
                prop_assert_eq!(row.contains(&target), pvs.sees(viewcell, target));
                prop_assert_eq!(row.contains(&target), bit);
            }
        }
    }

    #[test]
    fn no_bytes_panic(place in 0usize..400, byte: u8, target in 0u32..500) {
        let mut bytes = sample().bytes;
        let place = place % bytes.len();
        bytes[place] = byte;
        if let Ok(pvs) = Pvs::from_bytes(resealed(bytes)) {
            pvs.sees(ViewcellId(3), target);
            pvs.write_bits(ViewcellId(3), &mut Vec::new());
        }
    }
}
