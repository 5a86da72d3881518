//! Tests of glTF buffer views compressed by meshopt: with encoders written for these tests, and with codes
//! written by hand.

use crate::gltf_files::glb;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::Path;
use visibility_examples::gltf_file::parse;
use visibility_examples::{SceneSource, SourceError};
use visibility_testing::allocations::{LIVE, PEAK};

/// Reads a file with one primitive whose positions and indices are compressed. Each is given by the members
/// of the extension and the compressed bytes. `accessor` has the members of the position accessor other than
/// its view.
fn read(
    accessor: Value,
    positions: (Value, Vec<u8>),
    indices: Option<(Value, Vec<u8>)>,
) -> Result<SceneSource, SourceError> {
    let (mut bytes, mut views, mut primitive) =
        (Vec::new(), Vec::new(), json!({"attributes": {"POSITION": 0}}));
    let mut accessors = vec![accessor];
    accessors[0]["bufferView"] = json!(0);
    let mut push = |(mut extension, encoded): (Value, Vec<u8>)| {
        let size = extension["count"].as_u64().expect("a count")
            * extension["byteStride"].as_u64().expect("a stride");
        extension["buffer"] = json!(0);
        extension["byteOffset"] = json!(bytes.len());
        extension["byteLength"] = json!(encoded.len());
        bytes.extend(encoded);
        // The fallback buffer has no content, as in files that require the extension.
        let mut view =
            json!({"buffer": 1, "byteLength": size, "extensions": {"EXT_meshopt_compression": extension}});
        if extension["mode"] == "ATTRIBUTES" {
            view["byteStride"] = extension["byteStride"].clone();
        }
        views.push(view);
    };
    push(positions);
    if let Some((extension, encoded)) = indices {
        let component = if extension["byteStride"] == 2 { 5123 } else { 5125 };
        let count = extension["count"].clone();
        accessors
            .push(json!({"bufferView": 1, "componentType": component, "type": "SCALAR", "count": count}));
        push((extension, encoded));
        primitive["indices"] = json!(1);
    }
    let hash = bytes.iter().fold(0u64, |hash, &byte| hash.wrapping_mul(0x100_0000_01b3) ^ u64::from(byte));
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("meshopt-{hash:x}.bin"));
    std::fs::write(&path, &bytes).expect("a test file");
    let document = json!({
        "asset": {"version": "2.0"}, "extensionsRequired": ["EXT_meshopt_compression"],
        "nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}],
        "accessors": accessors, "bufferViews": views,
        "buffers": [
            {"byteLength": bytes.len(), "uri": path.file_name().and_then(|name| name.to_str())},
            {"byteLength": 1_000_000, "extensions": {"EXT_meshopt_compression": {"fallback": true}}}
        ]
    });
    let scene = parse(document.to_string().as_bytes(), &path.with_extension("gltf"));
    let _ = std::fs::remove_file(path);
    scene
}

/// Returns the points of a scene's triangles.
fn points(scene: &SceneSource) -> Vec<[f32; 3]> {
    scene.objects[0].triangles.iter().flatten().map(|p| p.to_array()).collect()
}

/// Encodes elements in version 0 or 1 of the format. `choice` picks one of the bit widths and controls that
/// can hold a group's differences. In version 1, `channels` selects how each four bytes are subtracted.
fn encode(
    elements: &[u8],
    stride: usize,
    version: u8,
    channels: &[u8],
    mut choice: impl FnMut(usize) -> usize,
) -> Vec<u8> {
    let mut out = vec![0xA0 | version];
    let first = elements[..stride].to_vec();
    let mut before = first.clone();
    let zigzag8 = |d: u8| d << 1 ^ (d as i8 >> 7) as u8;
    let zigzag16 = |d: u16| d << 1 ^ (d as i16 >> 15) as u16;
    let block = ((8192 / stride) & !15).min(256) * stride;
    for block in elements.chunks(block) {
        // Differences between consecutive elements.
        let mut differences = block.to_vec();
        for (element, out) in block.chunks(stride).zip(differences.chunks_mut(stride)) {
            for four in 0..stride / 4 {
                let at = 4 * four..4 * four + 4;
                let (a, b) = (&before[at.clone()], &element[at.clone()]);
                let word = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().expect("four bytes"));
                let half = |bytes: &[u8], i: usize| u16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]);
                let channel = channels.get(four).copied().unwrap_or(0);
                let d: Vec<u8> = match channel & 3 {
                    0 => (0..4).map(|i| zigzag8(b[i].wrapping_sub(a[i]))).collect(),
                    1 => (0..2)
                        .flat_map(|i| zigzag16(half(b, i).wrapping_sub(half(a, i))).to_le_bytes())
                        .collect(),
                    _ => (word(a) ^ word(b)).rotate_left(u32::from(channel >> 4)).to_le_bytes().to_vec(),
                };
                out[at].copy_from_slice(&d);
            }
            before = element.to_vec();
        }
        let column =
            |byte: usize| differences.iter().skip(byte).step_by(stride).copied().collect::<Vec<u8>>();
        // Control of each byte column: any control for a column of zeros, otherwise any except the one for
        // zeros.
        let controls: Vec<usize> = (0..stride)
            .map(|byte| if column(byte).iter().all(|&d| d == 0) { choice(4) } else { [0, 1, 3][choice(3)] })
            .collect();
        if version == 1 {
            out.extend(controls.chunks(4).map(|c| c.iter().rev().fold(0, |all, &c| all << 2 | c as u8)));
        }
        for (byte, &control) in controls.iter().enumerate() {
            let mut column = column(byte);
            let widths = match (version, control) {
                (0, _) => [0, 2, 4, 8],
                (_, 0) => [0, 1, 2, 4],
                (_, 1) => [1, 2, 4, 8],
                (_, 2) => continue,
                _ => {
                    out.extend(column);
                    continue;
                }
            };
            column.resize(column.len().next_multiple_of(16), 0);
            let (mut header, mut body) = (vec![0u8; column.len().div_ceil(64)], Vec::new());
            for (group, values) in column.chunks(16).enumerate() {
                let zero = values.iter().all(|&d| d == 0);
                let able: Vec<usize> = (0..4).filter(|&at| widths[at] > 0 || zero).collect();
                let at = able[choice(able.len())];
                header[group / 4] |= (at as u8) << (group % 4 * 2);
                let bits: usize = widths[at];
                match bits {
                    0 => {}
                    8 => body.extend(values),
                    _ => {
                        let greatest = (1u8 << bits) - 1;
                        let mut packed = vec![0u8; 2 * bits];
                        for (i, &value) in values.iter().enumerate() {
                            let shift = if bits == 1 { i % 8 } else { 8 - bits - i * bits % 8 };
                            packed[i * bits / 8] |= value.min(greatest) << shift;
                        }
                        body.extend(packed);
                        body.extend(values.iter().filter(|&&value| value >= greatest));
                    }
                }
            }
            out.extend(header);
            out.extend(body);
        }
    }
    let mut tail = first;
    tail.extend(channels);
    let least: usize = if version == 0 { 32 } else { 24 };
    out.resize(out.len() + least.saturating_sub(tail.len()), 0);
    out.extend(tail);
    out
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn attributes_of_both_versions_are_decoded(
        count in 1usize..200,
        version in 0u8..2,
        channels in proptest::collection::vec(prop::sample::select(vec![0u8, 1, 2, 0x52, 0xF2]), 3),
        steps in proptest::collection::vec(0usize..1000, 97),
        small in any::<bool>(),
    ) {
        let triangles: Vec<[f32; 3]> = (0..3 * count)
            .map(|i| [0, 1, 2].map(|axis| {
                let step = steps[(3 * i + axis) % steps.len()] as f32;
                if small { step.floor() % 3.0 } else { step * 1.37 - 400.0 }
            }))
            .collect();
        let bytes: Vec<u8> = triangles.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let channels = if version == 1 { channels } else { Vec::new() };
        let mut choices = steps.iter().cycle();
        let encoded = encode(&bytes, 12, version, &channels, |of| choices.next().expect("choices") % of);
        let extension = json!({"mode": "ATTRIBUTES", "byteStride": 12, "count": 3 * count});
        let accessor = json!({"componentType": 5126, "type": "VEC3", "count": 3 * count});
        let scene = read(accessor.clone(), (extension.clone(), encoded.clone()), None).expect("well encoded");
        prop_assert_eq!(points(&scene), triangles);
        // One byte too many or too few is an error.
        let mut more = encoded.clone();
        more.insert(1, 0);
        for damaged in [encoded[..encoded.len() - 1].to_vec(), more] {
            if let Err(error) = read(accessor.clone(), (extension.clone(), damaged), None) {
                prop_assert!(error.to_string().contains("damaged"), "{error}");
            }
        }
    }
}

/// Returns 102 positions along x, encoded without compression filters.
fn along_x() -> (Value, (Value, Vec<u8>)) {
    let bytes: Vec<u8> = (0..102).flat_map(|i| [i as f32, 0.0, 0.0]).flat_map(f32::to_le_bytes).collect();
    let extension = json!({"mode": "ATTRIBUTES", "byteStride": 12, "count": 102});
    let encoded = encode(&bytes, 12, 0, &[], |of| of - 1);
    (json!({"componentType": 5126, "type": "VEC3", "count": 102}), (extension, encoded))
}

#[test]
fn triangles_are_decoded() {
    /// Triangle codes written by hand, each with its extra bytes and the indices it must give. A code names
    /// an edge and a vertex by age, or three vertices.
    const CODES: [(u8, &[u8], [u32; 3]); 11] = [
        (0xF0, &[], [0, 1, 2]),             // three new vertices, by entry 0 of the table
        (0x10, &[], [2, 1, 3]),             // edge 2 1, a new vertex
        (0x00, &[], [2, 3, 4]),             // edge 2 3, a new vertex
        (0x04, &[], [2, 4, 0]),             // edge 2 4, the fifth last vertex
        (0x0F, &[0xC8, 0x01], [2, 0, 100]), // edge 2 0, 100 after the last index in full, which was 0
        (0x0E, &[], [2, 100, 101]),         // the index after that
        (0x0D, &[], [2, 101, 100]),         // the index before that
        (0xFF, &[0xFF, 0xB9, 0x01, 0x02, 0x02], [7, 8, 9]), // three indices in full
        (0xFE, &[0x00], [0, 1, 2]),         // new vertices, counted anew
        (0xFE, &[0x0F, 0x02], [3, 4, 10]),  // two new vertices and an index in full
        (0xF1, &[], [5, 10, 4]),            // a new vertex and the last two, by entry 1 of the table
    ];
    let expected: Vec<u32> = CODES.iter().flat_map(|(.., triangle)| *triangle).collect();
    let mut bytes = vec![0xE1];
    bytes.extend(CODES.iter().map(|(code, ..)| code));
    CODES.iter().for_each(|(_, data, _)| bytes.extend(*data));
    let mut table = [0; 16];
    table[1] = 0x12;
    bytes.extend(table);
    for stride in [2, 4] {
        let extension = json!({"mode": "TRIANGLES", "byteStride": stride, "count": 33});
        let (accessor, positions) = along_x();
        let scene = read(accessor.clone(), positions.clone(), Some((extension.clone(), bytes.clone())))
            .expect("good");
        let indices: Vec<u32> = points(&scene).iter().map(|p| p[0] as u32).collect();
        assert_eq!(indices, expected, "stride {stride}: indices decoded");
        for cut in [0, 1, 11, bytes.len() - 1] {
            let error =
                read(accessor.clone(), positions.clone(), Some((extension.clone(), bytes[..cut].to_vec())));
            assert!(error.expect_err("cut short").to_string().contains("damaged"), "{cut}");
        }
    }
}

#[test]
fn sequences_are_decoded() {
    let expected = [5u32, 6, 4, 100, 101, 7];
    let mut bytes = vec![0xD1];
    let mut last = [0i64; 2];
    for (i, &index) in expected.iter().enumerate() {
        // The encoder refers to the last two indices in turn.
        let (of, delta) = (i % 2, i64::from(index) - last[i % 2]);
        last[of] = i64::from(index);
        let mut number = ((delta << 1 ^ delta >> 63) as u32) << 1 | of as u32;
        while number >= 128 {
            bytes.push(number as u8 | 128);
            number >>= 7;
        }
        bytes.push(number as u8);
    }
    bytes.extend([0; 4]);
    let extension = json!({"mode": "INDICES", "byteStride": 4, "count": 6});
    let (accessor, positions) = along_x();
    let scene = read(accessor, positions, Some((extension, bytes))).expect("well encoded");
    assert_eq!(points(&scene).iter().map(|p| p[0] as u32).collect::<Vec<_>>(), expected, "indices decoded");
}

#[test]
fn exponents_are_applied() {
    // Test values as 24-bit mantissas and 8-bit exponents: 3 * 2^-1, -5 * 2^2, 0, 1 * 2^-24 and so on.
    let numbers = [(3, -1), (-5, 2), (0, 9), (1, -24), (-1, 0), (7, 1), (8_388_607, -22), (1, 100), (2, 2)];
    let bytes: Vec<u8> = numbers
        .iter()
        .flat_map(|&(mantissa, exponent): &(i32, i32)| (mantissa & 0xFF_FFFF | exponent << 24).to_le_bytes())
        .collect();
    let extension = json!({"mode": "ATTRIBUTES", "byteStride": 12, "count": 3, "filter": "EXPONENTIAL"});
    let accessor = json!({"componentType": 5126, "type": "VEC3", "count": 3});
    let encoded = encode(&bytes, 12, 0, &[], |of| of - 1);
    let scene = read(accessor.clone(), (extension.clone(), encoded.clone()), None).expect("well encoded");
    let expected = numbers.map(|(mantissa, exponent)| mantissa as f32 * 2.0f32.powi(exponent));
    assert_eq!(points(&scene).as_flattened(), expected, "numbers decoded");
    let wrong = [("filter", json!("OCTAHEDRAL")), ("count", json!(1u64 << 40)), ("mode", json!("OTHER"))];
    for (key, value) in wrong {
        let mut extension = extension.clone();
        extension[key] = value;
        let error = read(accessor.clone(), (extension, encoded.clone()), None).expect_err(key).to_string();
        assert!(error.contains("buffer view 0") && error.contains("meshopt"), "{key}: {error}");
    }
}

/// Makes a GLB file whose buffer views are compressed in the same 1,000 bytes, each without as many of the
/// last bytes as `cuts` says. The bytes are the shortest code for elements that are all alike, so a view has
/// nearly 1,024 times their size. The first `shown` views have the positions of a triangle each.
fn file_of_overlapping_views(cuts: &[usize], shown: usize) -> Vec<u8> {
    let mut bytes = [0xAA; 1000];
    bytes[0] = 0xA1;
    let views: Vec<Value> = cuts
        .iter()
        .map(|cut| {
            // Beside the blocks there are the first byte and the 24 last bytes.
            let (length, count) = (1000 - cut, 256 * (1000 - cut - 25));
            json!({"buffer": 0, "byteLength": 4 * count, "byteStride": 4, "extensions": {
                "EXT_meshopt_compression": {"buffer": 0, "byteLength": length, "byteStride": 4,
                    "count": count, "mode": "ATTRIBUTES"}}})
        })
        .collect();
    let each = |item: &dyn Fn(usize) -> Value| (0..shown).map(item).collect::<Vec<Value>>();
    let document = json!({
        "asset": {"version": "2.0"}, "buffers": [{"byteLength": 1000}], "bufferViews": views,
        "nodes": each(&|i| json!({"mesh": i})),
        "meshes": each(&|i| json!({"primitives": [{"attributes": {"POSITION": i}}]})),
        "accessors": each(&|i| json!({"bufferView": i, "componentType": 5120, "type": "VEC3", "count": 3}))
    });
    glb(&document, &bytes)
}

#[test]
fn memory_of_compressed_views_is_bounded_by_the_size_of_the_buffers() {
    let different: Vec<usize> = (0..30).collect();
    for (cuts, shown, objects) in
        [(&different[..], 1, Some(1)), (&[0; 30], 30, Some(30)), (&different, 30, None)]
    {
        let file = file_of_overlapping_views(cuts, shown);
        let before = LIVE.get();
        PEAK.set(before);
        let scene = parse(&file, Path::new("test.glb"));
        let peak = PEAK.get() - before;
        let what = format!("{} views, the first {shown} shown", cuts.len());
        // 1,024 times the buffer, and the document.
        assert!(peak < 1_024_000 + 100 * file.len() as isize, "{what}: {peak} bytes at once");
        match objects {
            Some(objects) => assert_eq!(scene.expect(&what).objects.len(), objects, "{what}: objects"),
            None => {
                let error = scene.expect_err(&what).to_string();
                let expected = "buffer view 1: with it, more compressed bytes would be decoded";
                assert!(error.contains(expected), "{what}: {error}");
            }
        }
    }
}
