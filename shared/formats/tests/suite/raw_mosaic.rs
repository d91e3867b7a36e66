//! Raw frames of mosaic cameras from PGM and TIFF files, real and damaged.

use formats::raw_mosaic::RawMosaic;
use formats::tiff::Tiff;
use random::Random;

/// A TIFF with one strip: (tag, value) of u32 fields, then the data.
fn tiff(big_endian: bool, fields: &[(u16, u32)], data: &[u8]) -> Vec<u8> {
    tiff_of_strips(big_endian, fields, &[data])
}

/// A TIFF with several strips.
fn tiff_of_strips(big_endian: bool, fields: &[(u16, u32)], strips: &[&[u8]]) -> Vec<u8> {
    let short = |value: u16| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
    let long = |value: u32| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
    let n = strips.len() as u32;
    let lists_at = 8 + 2 + 12 * (fields.len() as u32 + 2) + 4;
    let data_at = lists_at + if n > 1 { 8 * n } else { 0 };
    let offsets: Vec<u32> =
        strips.iter().scan(data_at, |at, strip| Some(std::mem::replace(at, *at + strip.len() as u32))).collect();
    let lengths: Vec<u32> = strips.iter().map(|strip| strip.len() as u32).collect();
    // A list of one value is stored in the field itself.
    let lists = if n > 1 { [lists_at, lists_at + 4 * n] } else { [offsets[0], lengths[0]] };
    let mut fields: Vec<(u16, u32, u32)> = fields.iter().map(|(tag, value)| (*tag, 1, *value)).collect();
    fields.extend([(273, n, lists[0]), (279, n, lists[1])]);
    fields.sort_unstable();
    let mut bytes = if big_endian { b"MM\0*".to_vec() } else { b"II*\0".to_vec() };
    bytes.extend(long(8));
    bytes.extend(short(fields.len() as u16));
    for (tag, count, value) in fields {
        bytes.extend([short(tag), short(4)].concat());
        bytes.extend([long(count), long(value)].concat());
    }
    bytes.extend(long(0));
    if n > 1 {
        bytes.extend(offsets.iter().chain(&lengths).flat_map(|value| long(*value)));
    }
    bytes.extend(strips.concat());
    bytes
}

/// Fields of a gray image of 3 x 2 pixels.
fn gray(depth: u32) -> Vec<(u16, u32)> {
    vec![(256, 3), (257, 2), (258, depth), (259, 1), (262, 1)]
}

#[test]
fn images_of_both_byte_orders_and_depths_are_read() {
    let samples: [u16; 6] = [0, 1, 300, 1023, 256, 65_535];
    for big_endian in [false, true] {
        let data: Vec<u8> =
            samples.iter().flat_map(|v| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() }).collect();
        let deep = RawMosaic::parse(&tiff(big_endian, &gray(16), &data)).expect("parses");
        assert_eq!((deep.width, deep.height, deep.bit_depth, &deep.samples[..]), (3, 2, 16, &samples[..]));
        let shallow = RawMosaic::parse(&tiff(big_endian, &gray(8), &[0, 1, 2, 253, 254, 255])).expect("parses");
        assert_eq!((shallow.bit_depth, &shallow.samples[..]), (8, &[0, 1, 2, 253, 254, 255][..]));
        // Samples are also used as stored if small values are white.
        let mut white_is_zero = gray(16);
        white_is_zero[4].1 = 0;
        let white_is_zero = RawMosaic::parse(&tiff(big_endian, &white_is_zero, &data)).expect("parses");
        assert_eq!(white_is_zero.samples, samples);
    }
    let pgm = RawMosaic::parse(b"P5 2 1 1023 \x03\xff\x00\x01").expect("parses");
    assert_eq!((pgm.width, pgm.height, pgm.bit_depth, pgm.samples), (2, 1, 10, vec![1023, 1]));
}

#[test]
fn binned_cube_is_converted_back_to_its_mosaic() {
    // Two cells of four bands: interleaved, then in planes.
    let fields = |planar| vec![(256, 2), (257, 1), (258, 8), (259, 1), (262, 1), (277, 4), (284, planar)];
    let interleaved = tiff(false, &fields(1), &[1, 2, 3, 4, 11, 12, 13, 14]);
    let planes = tiff_of_strips(false, &fields(2), &[&[1, 11], &[2, 12], &[3, 13], &[4, 14]]);
    for bytes in [interleaved, planes] {
        let mosaic = RawMosaic::parse(&bytes).expect("parses");
        assert_eq!((mosaic.width, mosaic.height, mosaic.samples), (4, 2, vec![1, 2, 11, 12, 3, 4, 13, 14]));
    }
    let rgb = tiff(false, &[(256, 1), (257, 1), (258, 8), (262, 2), (277, 3)], &[1, 2, 3]);
    let error = RawMosaic::parse(&rgb).expect_err("RGB").to_string();
    assert!(error.contains("3 samples per pixel"), "{error}");
}

#[test]
fn faults_are_reported() {
    let with = |tag: u16, value: u32| {
        let mut fields = gray(8);
        fields.retain(|field| field.0 != tag);
        fields.push((tag, value));
        tiff(false, &fields, &[0; 6])
    };
    for (bytes, rule) in [
        (b"II*\0".to_vec(), "TIFF: "),
        (b"GIF89a".to_vec(), "expected P5"),
        (with(256, 0), "TIFF: "),
        (with(256, 40_000), "ImageWidth is 40000; expected 1 to 32768"),
        (with(258, 12), "BitsPerSample is [12]; expected 8 or 16"),
        (with(259, 5), "Compression is 5; expected 1"),
        (with(339, 3), "SampleFormat is [3]; expected 1"),
        (with(257, 3), "strips hold 6 bytes, the image of 3 x 3 pixels needs 9"),
        (with(257, 1), "strips hold 6 bytes, the image of 3 x 1 pixels needs 3"),
        (tiff(false, &gray(8), &[0; 5]), "strips hold 5 bytes, the image of 3 x 2 pixels needs 6"),
        (tiff(false, &gray(8), &[0; 6])[..98].to_vec(), "TIFF: "),
    ] {
        let error = RawMosaic::parse(&bytes).expect_err(rule).to_string();
        assert!(error.contains(rule), "{error}; expected {rule}");
    }
}

#[real_data::test("photonfocus/frame_02245_vis.tif", "photonfocus/frame_02245_nir.tif", "mosaic/4_baichideng2_11.tif")]
fn real_frames_have_known_size_and_exposure() {
    for (name, size, exposure_nanos) in [("vis", [2048, 1024], 13_270_000), ("nir", [2045, 1085], 3_650_000)] {
        let path = real_data::path(&format!("photonfocus/frame_02245_{name}.tif"));
        let mosaic = RawMosaic::read(&path).expect("a frame");
        assert_eq!(([mosaic.width, mosaic.height], mosaic.bit_depth), (size, 8), "{name}");
        assert_eq!(mosaic.exposure_nanos, Some(exposure_nanos), "{name}");
    }
    let path = real_data::path("mosaic/4_baichideng2_11.tif");
    let mosaic = RawMosaic::read(&path).expect("a frame");
    assert_eq!((mosaic.width, mosaic.height, mosaic.bit_depth, mosaic.exposure_nanos), (2048, 1024, 8, None));
    let mean = mosaic.samples.iter().map(|v| f64::from(*v)).sum::<f64>() / mosaic.samples.len() as f64;
    assert!((1.0..254.0).contains(&mean), "{mean}");
}

#[real_data::test("photonfocus/frame_02245_vis.tif")]
fn damaged_and_truncated_real_frame_is_refused() {
    let file = std::fs::read(real_data::path("photonfocus/frame_02245_vis.tif")).expect("readable");
    let mut refused = 0;
    let mut random = Random::new(12_345);
    for _ in 0..400 {
        // Nearly all metadata lies in the first 2500 bytes.
        let mut bytes = file[..4000].to_vec();
        for _ in 0..4 {
            let at = random.index(2500);
            bytes[at] = random.bits() as u8;
        }
        refused += u32::from(Tiff::parse(&bytes).is_err());
    }
    assert_eq!(refused, 400, "a file of 4000 bytes does not hold the image");
}
