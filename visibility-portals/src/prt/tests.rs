use super::*;
use std::format;

const ONE: &str = "4 0 1 (0 0 0) (0 1 0) (0 1 1) (0 0 1)";

#[test]
fn all_three_forms_give_the_same_graph() {
    let plain = read(&format!("PRT1\n2\n1\n{ONE}\n")).unwrap();
    let grouped = read(&format!("PRT2\n4\n2\n1\n{ONE}\n0 2 -1\n3 -1\n")).unwrap();
    let other = read(&format!("PRT1-AM\r\n2\r\n1\r\n3\r\n{ONE} \r\n1\r\n0\r\n1\r\n")).unwrap();
    assert!(plain.graph == grouped.graph && plain.graph == other.graph, "the same graph in three forms");
    let leaves = |file: PortalFile| file.cell_of_leaf.iter().map(|c| c.map(|c| c.0)).collect::<Vec<_>>();
    assert_eq!(leaves(plain), [], "the plain form has no leaves");
    assert_eq!(leaves(grouped), [Some(0), None, Some(0), Some(1)], "cells of the grouped form's leaves");
    assert_eq!(leaves(other), [Some(1), Some(0), Some(1)], "cells of the third form's leaves");
}

#[test]
fn what_was_written_reads_the_same() {
    // Empty lines may follow.
    let text = "PRT1\n3\n2\n3 0 1 (0.1 0 0) (0.1 1e-3 0) (0.1 0.3333333333333333 7)\n\
        4 2 1 (5 0 0) (5 1 0) (5 1 1) (5 0 1)\n \n\n";
    let file = read(text).unwrap();
    assert_eq!(read(&write(&file.graph)).unwrap(), file, "the file as written");
}

#[test]
fn errors_say_where() {
    for (text, expected) in [
        ("", "the file ends after line 0, where a line PRT1, PRT2 or PRT1-AM should follow"),
        ("PRT3\n", "line 1: this is not a portal file: PRT1, PRT2 or PRT1-AM should stand here"),
        ("PRT1\n2\n", "the file ends after line 2, where the number of portals should follow"),
        ("PRT1\n2\nx\n", "line 3: the number of portals should stand here, not `x`"),
        ("PRT1\n-2\n1\n", "line 2: the number of cells should stand here, not `-2`"),
        (
            "PRT1\n2\n2\n4 0 1 (0 0 0) (0 1 0) (0 1 1) (0 0 1)\n",
            "the file ends after line 4, where the line of a portal should follow",
        ),
        (
            "PRT1\n2\n1\n4 0 2 (0 0 0) (0 1 0) (0 1 1) (0 0 1)\n",
            "line 4: portal 0 leads to cell 2, but there are only 2",
        ),
        (
            "PRT1\n2\n\n1\n\n\n4 0 2 (0 0 0) (0 1 0) (0 1 1) (0 0 1)\n",
            "line 7: portal 0 leads to cell 2, but there are only 2",
        ),
        ("PRT1\n2\n1\n4 0 1 (0 0 0) (0 z 0) (0 1 1) (0 0 1)\n", "line 4: vertex 2 of 4: `z` is not a number"),
        (
            "PRT1\n2\n1\n3 0 1 (0 0 0) (0 1 0) (0 1 1) (0 0 1)\n",
            "line 4: more than the 3 vertices that it announces",
        ),
        (
            "PRT1\n2\n1\n3 0 1 (0 0 0) (0 nan 0) (0 1 1)\n",
            "line 4, portal 0: vertex 1 of the polygon is not finite",
        ),
        ("PRT1\n2\n1\n4000000000 0 1 (0 0 0)\n", "line 4: 4000000000 vertices are more than 64"),
        (
            "PRT1\n3\n1\n4 0 1 (0 0 0) (0 1 0) (0 1 1) (0 0 1)\n\n4 1 2 (5 0 0) (5 1 0) (5 1 1) (5 0 1)\n",
            "line 6: more lines than the counts announce",
        ),
        ("PRT2\n2\n1\n0\n1 -1\n0 -1\n", "line 6: more lines than the counts announce"),
        ("PRT1-AM\n1\n0\n1\n0\n0\n", "line 6: more lines than the counts announce"),
        ("PRT1\n4294967295\n0\n", "line 3: 4294967295 cells are too many"),
        ("PRT1\n66000\n0\n", "line 3: 66000 cells are too many"),
        ("PRT2\n4294967290\n1\n0\n0 -1\n", "line 4: 4294967290 leaves are too many"),
        ("PRT1-AM\n1\n0\n66000\n", "line 4: 66000 leaves are too many"),
        ("PRT2\n2\n1\n0\n5 -1\n", "line 5: there is no such leaf"),
        ("PRT2\n2\n1\n0\n2 -1\n", "line 5: there is no such leaf"),
        ("PRT1-AM\n1\n0\n1\n1\n", "line 5: there is no such cell"),
        ("PRT2\n2\n1\n0\n1\n", "line 5: the closing -1 is missing"),
    ] {
        assert_eq!(read(text).unwrap_err().to_string(), expected, "{text:?}");
    }
}

#[test]
fn portals_that_are_not_planar_or_not_convex_are_named() {
    let second = |vertices: &str| read(&format!("PRT1\n3\n2\n{ONE}\n4 1 2 {vertices}\n")).unwrap_err();
    let bent = second("(9 0 0) (9 1 0) (9.5 1 1) (9 0 1)");
    let dart = second("(9 0 0) (9 4 0) (9 1 1) (9 0 4)");
    let named = |error: PrtError| match error {
        PrtError::Polygon { line: 5, portal: PortalId(1), error } => error,
        other => panic!("{other}"),
    };
    assert!(dart.to_string().starts_with("line 5, portal 1: the polygon is not convex"), "{dart}");
    assert!(matches!(named(bent), PolygonError::NotPlanar { .. }), "a bent polygon");
    assert!(matches!(named(dart), PolygonError::NotConvex { .. }), "a dart");
}

#[test]
fn cells_without_portals_are_read() {
    assert_eq!(
        read("PRT1\n60000\n0\n").unwrap().graph.cell_count(),
        60_000,
        "cells of a file without portals"
    );
}

#[test]
fn no_prefix_and_no_changed_byte_panics() {
    let text = format!("PRT2\n4\n2\n1\n{ONE}\n0 2 -1\n3 -1\n");
    for end in 0..text.len() {
        let _ = read(&text[..end]);
        for byte in *b"9-(. e\n" {
            let mut bytes = text.clone().into_bytes();
            bytes[end] = byte;
            let _ = read(core::str::from_utf8(&bytes).unwrap());
        }
    }
}

#[test]
fn counts_at_their_limits_are_read() {
    let ring = |count: usize| {
        let angles = (0..count).map(|i| i as f64 / count as f64 * core::f64::consts::TAU);
        let corners: String = angles.map(|angle| format!(" ({} {} 0)", angle.cos(), angle.sin())).collect();
        read(&format!("PRT1\n2\n1\n{count} 0 1{corners}\n"))
    };
    assert!(ring(64).is_ok(), "a portal of as many vertices as there may be");
    assert_eq!(ring(65).unwrap_err().to_string(), "line 4: 65 vertices are more than 64", "one more");
    // As many cells as the length of the text and 65,536 allow, and one more.
    let length = "PRT1\n65550\n0\n".len();
    for (cells, is_read) in [(65_536 + length, true), (65_536 + length + 1, false)] {
        assert_eq!(read(&format!("PRT1\n{cells}\n0\n")).is_ok(), is_read, "{cells} cells");
    }
    let file = read("PRT1\n2\n1\n3\t0 1(0 0 0)(0 1\t0)(0 1 1)\n").unwrap();
    assert_eq!(file.graph.portals().len(), 1, "words that tabs and parentheses divide");
}
