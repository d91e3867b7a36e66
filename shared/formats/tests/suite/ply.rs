//! PLY files: bytes, round trips, other encodings, and errors.

use formats::ply::{Header, Kind, PlyError, PlyRows, PlyWriter, Vertices};
use ply_rs::parser::Parser;
use ply_rs::ply::{DefaultElement, Property as Value};
use ply_rs::writer::Writer;
use random::Random;
use std::path::Path;

fn header() -> Header {
    Header::new([("x", Kind::Float), ("timestamp", Kind::Double), ("ring", Kind::UChar), ("index_frame", Kind::Int)])
        .comment("made by a test")
        .info("frame local east-north-up")
}

#[derive(Clone, Copy)]
struct Point(f32, f64, u8, i32);

fn random_points(n: usize, seed: u64) -> Vec<Point> {
    let mut random = Random::new(seed);
    let finite = |bits: u32| Some(f32::from_bits(bits)).filter(|x| x.is_finite()).unwrap_or(-0.0);
    let point = |random: &mut Random| {
        let x = finite(random.bits() as u32);
        Point(x, random.bits() as f64 * 1e-9, random.bits() as u8, random.bits() as i32)
    };
    (0..n).map(|_| point(&mut random)).collect()
}

fn write(path: &Path, points: &[Point]) -> u64 {
    let mut writer = PlyWriter::create(path, &header(), points.len()).expect("creates");
    let encode = |i: usize, row: &mut formats::ply::Row<'_>| {
        let Point(x, timestamp, ring, frame) = points[i];
        row.f32(x).f64(timestamp).u8(ring).i32(frame);
    };
    writer.write_each(points.len(), encode).expect("writes");
    writer.finish().expect("finishes")
}

type Encode = fn(&mut formats::ply::Row<'_>);

fn packed(points: &[Point]) -> Vec<u8> {
    let row = |p: &Point| [&p.0.to_le_bytes()[..], &p.1.to_le_bytes(), &[p.2], &p.3.to_le_bytes()].concat();
    points.iter().flat_map(row).collect()
}

#[test]
fn written_bytes_follow_the_format() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("cloud.ply");
    let size = write(&path, &[Point(1.5, -2.0, 7, -1), Point(0.0, 1e9, 255, 65536)]);
    let text = b"ply\nformat binary_little_endian 1.0\ncomment made by a test\nobj_info frame local east-north-up\n\
        element vertex 2\nproperty float x\nproperty double timestamp\nproperty uchar ring\nproperty int index_frame\n\
        end_header\n";
    #[rustfmt::skip]
    let rows = [
        0, 0, 0xc0, 0x3f,  0, 0, 0, 0, 0, 0, 0, 0xc0,  7,  0xff, 0xff, 0xff, 0xff,
        0, 0, 0, 0,  0, 0, 0, 0, 0x65, 0xcd, 0xcd, 0x41,  255,  0, 0, 1, 0,
    ];
    let bytes = std::fs::read(&path).expect("reads");
    assert_eq!(bytes, [&text[..], &rows].concat());
    assert_eq!(size, bytes.len() as u64);
}

#[test]
fn random_rows_read_back_bit_for_bit_here_and_with_ply_rs() {
    let folder = tempfile::tempdir().expect("a folder");
    // Sizes around the block of 4096 rows, and an empty cloud.
    for (seed, n) in [0, 1, 4095, 4096, 4097, 30_000].into_iter().enumerate() {
        let path = folder.path().join(format!("{n}.ply"));
        let points = random_points(n, seed as u64);
        write(&path, &points);
        let ours = Vertices::load(&path).expect("reads");
        assert_eq!(ours.len(), n);
        assert_eq!(ours.rows(), packed(&points));
        assert_eq!(ours.infos(), ["frame local east-north-up"]);
        let xs: Vec<u32> = ours.f32s("x").expect("is there").into_iter().map(f32::to_bits).collect();
        assert_eq!(xs, points.iter().map(|p| p.0.to_bits()).collect::<Vec<_>>());
        assert_eq!(ours.f64s("timestamp").expect("is there"), points.iter().map(|p| p.1).collect::<Vec<_>>());
        assert_eq!(ours.u8s("ring").expect("is there"), points.iter().map(|p| p.2).collect::<Vec<_>>());
        assert_eq!(ours.i64s("index_frame").expect("is there"), points.iter().map(|p| p.3 as i64).collect::<Vec<_>>());

        let mut file = std::fs::File::open(&path).expect("opens");
        let theirs = Parser::<DefaultElement>::new().read_ply(&mut file).expect("ply-rs reads it");
        assert_eq!(theirs.payload["vertex"].len(), n);
        for (theirs, ours) in theirs.payload["vertex"].iter().zip(&points) {
            assert_eq!(theirs["x"], Value::Float(ours.0));
            assert_eq!(theirs["timestamp"], Value::Double(ours.1));
            assert_eq!(theirs["ring"], Value::UChar(ours.2));
            assert_eq!(theirs["index_frame"], Value::Int(ours.3));
        }
    }
}

#[test]
fn written_file_equals_the_file_of_ply_rs() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("cloud.ply");
    write(&path, &random_points(5000, 6));
    let ours = std::fs::read(&path).expect("reads");
    let mut cloud = Parser::<DefaultElement>::new().read_ply(&mut &ours[..]).expect("ply-rs reads it");
    let mut theirs = Vec::new();
    Writer::new().write_ply(&mut theirs, &mut cloud).expect("ply-rs writes it");
    assert!(ours == theirs, "header and rows must equal the output of ply-rs");
}

#[test]
fn rows_written_in_pieces_give_the_same_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let once = folder.path().join("once.ply");
    let pieces = folder.path().join("pieces.ply");
    let points = random_points(10_000, 3);
    write(&once, &points);
    let mut writer = PlyWriter::create(&pieces, &header(), points.len()).expect("creates");
    let encode = |i: usize, row: &mut formats::ply::Row<'_>| {
        let Point(x, timestamp, ring, frame) = points[i];
        row.f32(x).f64(timestamp).u8(ring).i32(frame);
    };
    writer.write_each(1, encode).expect("writes");
    writer.write_each(8_998, |i, row| encode(i + 1, row)).expect("writes");
    // The rest is copied from the other file.
    let rows = PlyRows::open(&once).expect("opens");
    assert_eq!((rows.len(), rows.header()), (points.len(), &header()));
    assert_eq!(rows.n_bytes(), std::fs::metadata(&once).expect("is there").len());
    writer.write_blocks(1001, |first, block| rows.read_into(8_999 + first, block)).expect("writes");
    assert!(rows.read_into(9_999, &mut [0; 18]).is_err(), "a row and a byte");
    writer.finish_unsynced().expect("finishes");
    files::atomic_file::sync(&pieces).expect("syncs");
    assert_eq!(std::fs::read(once).expect("reads"), std::fs::read(pieces).expect("reads"));
}

#[test]
fn every_encoding_and_type_is_read_equally() {
    let types = "property char a\nproperty uchar b\nproperty int16 c\nproperty uint16 d\nproperty int e\n\
        property uint32 f\nproperty float g\nproperty float64 h\n";
    let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
    let rows = [[-128.0, 255.0, -32768.0, 65535.0, -2_147_483_648.0, 4_294_967_295.0, 0.5, -1e-3], [1.0; 8]];
    let head = |encoding: &str| format!("ply\nformat {encoding} 1.0\nelement vertex 2\n{types}end_header\n");
    let ascii: Vec<String> = rows.iter().map(|row| row.map(|v| v.to_string()).join(" ")).collect();
    let ascii = head("ascii") + &ascii.join("\n") + "\n";
    let binary = |big: bool| {
        let order = |bytes: &[u8]| if big { bytes.iter().rev().copied().collect() } else { bytes.to_vec() };
        let row = |r: &[f64; 8]| {
            [
                order(&(r[0] as i8).to_le_bytes()),
                order(&(r[1] as u8).to_le_bytes()),
                order(&(r[2] as i16).to_le_bytes()),
                order(&(r[3] as u16).to_le_bytes()),
                order(&(r[4] as i32).to_le_bytes()),
                order(&(r[5] as u32).to_le_bytes()),
                order(&(r[6] as f32).to_le_bytes()),
                order(&r[7].to_le_bytes()),
            ]
            .concat()
        };
        let name = if big { "binary_big_endian" } else { "binary_little_endian" };
        [head(name).into_bytes(), rows.iter().flat_map(row).collect()].concat()
    };
    for file in [ascii.into_bytes(), binary(false), binary(true)] {
        let vertices = Vertices::decode(file, Path::new("types.ply")).expect("decodes");
        for (column, name) in names.iter().enumerate() {
            assert_eq!(vertices.f64s(name).expect("is there"), rows.map(|row| row[column]), "{name}");
        }
    }
}

#[test]
fn lists_and_other_elements_are_skipped() {
    let head = "ply\nformat binary_little_endian 1.0\nelement camera 1\nproperty list uchar int ids\nelement vertex 2\n\
        property float x\nproperty list uchar float more\nproperty uchar ring\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n";
    let mut file = head.as_bytes().to_vec();
    file.extend([1, 9, 0, 0, 0]);
    file.extend([0, 0, 0x80, 0x3f, 0, 5]);
    file.extend([0, 0, 0, 0x40, 1, 1, 1, 1, 1, 6]);
    let vertices = Vertices::decode(file, Path::new("lists.ply")).expect("decodes, though the face is cut");
    assert_eq!(vertices.f32s("x").expect("is there"), [1.0, 2.0]);
    assert_eq!(vertices.u8s("ring").expect("is there"), [5, 6]);
    assert!(!vertices.has("more"));
}

#[test]
fn headers_that_other_readers_misread_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("cloud.ply");
    let refused = [
        (header().comment("no end_header here"), "line 4"),
        (header().info("one element"), "line 5"),
        (header().comment("two\nlines"), "line 4"),
        (Header::new([("x", Kind::Float), ("x", Kind::Float)]), "occurs twice"),
        (Header::new([("x y", Kind::Float)]), "must be letters"),
        (Header::new([("", Kind::Float)]), "must be letters"),
        (Header::new([("instance", Kind::UInt)]), "some readers skip others"),
    ];
    for (header, text) in refused {
        let error = PlyWriter::create(&path, &header, 0).expect_err("is refused").to_string();
        assert!(error.contains("cloud.ply") && error.contains(text), "{error}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("lists").count(), 0);
}

#[test]
fn rows_that_do_not_match_the_header_are_refused_and_leave_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("cloud.ply");
    let create = || PlyWriter::create(&path, &header(), 2).expect("creates");
    let wrong: [(Encode, &str); 3] = [
        (|row| _ = row.f32(1.0).f64(1.0).u8(1), "missing"),
        (|row| _ = row.f32(1.0).f64(1.0).u8(1).i32(1).u8(1), "beyond"),
        (|row| _ = row.f32(1.0).f64(1.0).u8(1).f32(1.0), "property is int"),
    ];
    for (encode, text) in wrong {
        let error = create().write_each(2, |_, row| encode(row)).expect_err("is refused").to_string();
        assert!(error.contains("point 0") && error.contains(text), "{error}");
    }
    assert!(matches!(create().write_blocks(3, |_, _| Ok(())), Err(PlyError::Row { .. })));
    let mut short = create();
    short.write_blocks(1, |_, _| Ok(())).expect("fits");
    let error = short.finish().expect_err("one row is missing").to_string();
    assert!(error.contains("declares 2 points"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("lists").count(), 0);
}

#[test]
fn invalid_files_are_refused_with_line_or_byte() {
    let refused: [(&str, &str); 10] = [
        ("", "line 1: not a PLY file"),
        ("ply\rformat ascii 1.0\relement vertex 0\rend_header\r", "lines end with carriage returns only"),
        ("ply\nformat ascii 1.0\nelement vertex 1\n", "without `end_header`"),
        ("ply\nformat ascii 1.0\nelement vertex x\nend_header\n", "line 3"),
        ("ply\nformat ascii 1.0\nelement face 1\nproperty int a\nend_header\n1\n", "no element `vertex`"),
        ("ply\nformat ascii 1.0\nelement vertex 9\nend_header\n", "have no scalar property"),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int x\nend_header\n1 2\n", "same name"),
        ("ply\nformat ascii 1.0\nelement vertex 2\nproperty int x\nend_header\n1\n", "byte 66: row 1 of vertex"),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty uchar x\nend_header\n256\n", "row 0 of vertex"),
        (
            "ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\nproperty double x\nend_header\n1",
            "ends before the 99999999999 rows of vertex, 8 bytes each",
        ),
    ];
    for (file, text) in refused {
        let error = Vertices::decode(file.as_bytes().to_vec(), Path::new("broken.ply")).expect_err(file).to_string();
        assert!(error.starts_with("broken.ply: ") && error.contains(text), "{file:?}: {error}");
    }
    let one = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n300.5\n";
    let one = Vertices::decode(one.as_bytes().to_vec(), Path::new("one.ply")).expect("decodes");
    assert!(one.f64s("y").expect_err("is absent").to_string().contains("the file has x"));
    assert!(one.i64s("x").expect_err("is not whole").to_string().contains("300.5, not an integer"));
}

#[test]
fn damaged_files_do_not_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("cloud.ply");
    write(&path, &random_points(20, 1));
    let plain = std::fs::read(&path).expect("reads");
    let ascii = b"ply\nformat ascii 1.0\ncomment c\nelement vertex 3\nproperty float x\nproperty list uchar int l\n\
        property uint u\nelement face 1\nproperty list uchar int i\nend_header\n1.5 2 1 2 3\n-1e3 0 7\n0 1 1 1\n3 1 2 3\n";
    let big = String::from_utf8_lossy(ascii).replace("ascii", "binary_big_endian").into_bytes();
    let mut random = Random::new(48);
    let mut read = 0;
    let mut refused = 0;
    for round in 0..30_000 {
        let mut file = [&plain[..], ascii, &big][round % 3].to_vec();
        for _ in 0..=random.index(4) {
            let at = random.index(file.len());
            match random.index(4) {
                0 => file.truncate(at.max(1)),
                1 => _ = file.remove(at.min(file.len() - 1)),
                2 => file.insert(at, b"0123456789 -.\nae"[random.index(16)]),
                _ => file[at] = random.bits() as u8,
            }
            if file.is_empty() {
                file.push(b'p');
            }
        }
        match Vertices::decode(file, Path::new("mutated.ply")) {
            Ok(vertices) => {
                read += 1;
                for property in vertices.properties() {
                    let values = vertices.f64s(&property.name).expect("a listed column is there");
                    assert_eq!(values.len(), vertices.len());
                }
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().starts_with("mutated.ply: "));
            }
        }
    }
    assert!(read > 1000 && refused > 1000, "{read} read, {refused} refused: the mutations test one side only");
}

#[test]
fn invalid_numbers_of_windows_and_comments_in_latin1_are_read() {
    let file = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nend_header\n\
        -nan(ind) 1.0\n-1.#IND00 1.#QNAN0\n2 3\n";
    let cloud = Vertices::decode(file.as_bytes().to_vec(), Path::new("nan.ply")).expect("decodes");
    let xs = cloud.f64s("x").expect("is there");
    assert!(xs[0].is_nan() && xs[1].is_nan() && xs[2] == 2.0, "{xs:?}");
    let [head, rest] =
        ["ply\nformat binary_little_endian 1.0\ncomment Stra", "e\nelement vertex 1\nproperty float x\nend_header\n"];
    let file = [head.as_bytes(), &[0xdf], rest.as_bytes(), &1.5_f32.to_le_bytes()].concat();
    let cloud = Vertices::decode(file, Path::new("latin1.ply")).expect("decodes");
    assert_eq!((cloud.f64s("x").expect("is there"), cloud.comments()[0].as_str()), (vec![1.5], "Straße"));
}
