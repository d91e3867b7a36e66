//! Raw frames of mosaic cameras out of PGM and TIFF files, real and broken.

use formats::raw_mosaic::RawMosaic;
use formats::tiff::Tiff;
use real_data::real_data;

/// A TIFF of one strip: (tag, value) of u32 fields, then the data.
fn tiff(big_endian: bool, fields: &[(u16, u32)], data: &[u8]) -> Vec<u8> {
    let short = |value: u16| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
    let long = |value: u32| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
    let strip = [(273, 8 + 2 + 12 * (fields.len() as u32 + 2) + 4), (279, data.len() as u32)];
    let mut bytes = if big_endian { b"MM\0*".to_vec() } else { b"II*\0".to_vec() };
    bytes.extend(long(8));
    bytes.extend(short(fields.len() as u16 + 2));
    for (tag, value) in fields.iter().copied().chain(strip) {
        bytes.extend([short(tag), short(4)].concat());
        bytes.extend([long(1), long(value)].concat());
    }
    bytes.extend(long(0));
    bytes.extend(data);
    bytes
}

fn gray(depth: u32) -> Vec<(u16, u32)> {
    vec![(256, 3), (257, 2), (258, depth), (259, 1)]
}

#[test]
fn both_byte_orders_and_depths_give_the_samples() {
    let samples: [u16; 6] = [0, 1, 300, 1023, 256, 65_535];
    for big_endian in [false, true] {
        let data: Vec<u8> =
            samples.iter().flat_map(|v| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() }).collect();
        let deep = RawMosaic::parse(&tiff(big_endian, &gray(16), &data)).expect("parses");
        assert_eq!((deep.width, deep.height, deep.bit_depth, &deep.samples[..]), (3, 2, 16, &samples[..]));
        let shallow = RawMosaic::parse(&tiff(big_endian, &gray(8), &[0, 1, 2, 253, 254, 255])).expect("parses");
        assert_eq!((shallow.bit_depth, &shallow.samples[..]), (8, &[0, 1, 2, 253, 254, 255][..]));
    }
    let pgm = RawMosaic::parse(b"P5 2 1 1023 \x03\xff\x00\x01").expect("parses");
    assert_eq!((pgm.width, pgm.height, pgm.bit_depth, pgm.samples), (2, 1, 10, vec![1023, 1]));
}

#[test]
fn a_binned_cube_goes_back_into_its_mosaic() {
    // Two cells of four bands, the bands of a cell side by side, then plane after plane.
    let fields = |planar| vec![(256, 2), (257, 1), (258, 8), (259, 1), (277, 4), (284, planar)];
    for (planar, data) in [(1, [1, 2, 3, 4, 11, 12, 13, 14]), (2, [1, 11, 2, 12, 3, 13, 4, 14])] {
        let mosaic = RawMosaic::parse(&tiff(false, &fields(planar), &data)).expect("parses");
        assert_eq!((mosaic.width, mosaic.height, mosaic.samples), (4, 2, vec![1, 2, 11, 12, 3, 4, 13, 14]));
    }
    let error = RawMosaic::parse(&tiff(false, &[(256, 1), (257, 1), (258, 8), (277, 3)], &[1, 2, 3])).expect_err("RGB");
    assert!(error.contains("3 samples a pixel"), "{error}");
}

#[test]
fn faults_are_named() {
    let with = |tag: u16, value: u32| {
        let mut fields = gray(8);
        fields.retain(|field| field.0 != tag);
        fields.push((tag, value));
        tiff(false, &fields, &[0; 6])
    };
    for (bytes, rule) in [
        (b"II*\0".to_vec(), "byte 4: must lie in the file's 4 bytes"),
        (b"GIF89a".to_vec(), "must begin with P5"),
        (with(256, 0), "tag 256 must be there, with a value of 1 to 32768"),
        (with(258, 12), "[12] bits a sample; must be 8 or 16"),
        (with(259, 5), "compression [5]; must be 1"),
        (with(339, 3), "sample format [3]; must be 1"),
        (with(257, 3), "the strips hold 6 bytes; the image has 9"),
        (with(257, 1), "the strips hold more than the image's 3 bytes"),
        (tiff(false, &gray(8), &[0; 5]), "the strips hold 5 bytes; the image has 6"),
        (tiff(false, &gray(8), &[0; 6])[..88].to_vec(), "a strip of 6 bytes; the file has 88"),
    ] {
        let error = RawMosaic::parse(&bytes).expect_err(rule);
        assert!(error.contains(rule), "{error}; expected {rule}");
    }
}

#[test]
fn the_real_cameras_frames_have_their_exposures_and_their_mosaics_patterns() {
    for (name, size, exposure_nanos) in [("vis", [2048, 1024], 13_270_000), ("nir", [2045, 1085], 3_650_000)] {
        let Some(path) = real_data(&format!("photonfocus/frame_02245_{name}.tif")) else { return };
        let mosaic = RawMosaic::read(&path).expect("a frame");
        assert_eq!(([mosaic.width, mosaic.height], mosaic.bit_depth), (size, 8), "{name}");
        assert_eq!(mosaic.exposure_nanos, Some(exposure_nanos), "{name}");
    }
    let Some(path) = real_data("mosaic/4_baichideng2_11.tif") else { return };
    let mosaic = RawMosaic::read(&path).expect("a frame");
    assert_eq!((mosaic.width, mosaic.height, mosaic.bit_depth, mosaic.exposure_nanos), (2048, 1024, 8, None));
    let mean = mosaic.samples.iter().map(|v| f64::from(*v)).sum::<f64>() / mosaic.samples.len() as f64;
    assert!((1.0..254.0).contains(&mean), "{mean}");
}

#[test]
fn whatever_is_done_to_a_real_file_ends_in_an_image_or_an_error() {
    let Some(path) = real_data("photonfocus/frame_02245_vis.tif") else { return };
    let file = std::fs::read(path).expect("readable");
    let (mut refused, mut state) = (0, 12_345_u64);
    for _ in 0..400 {
        // Nearly all that can go wrong stands in the first 2500 bytes.
        let mut bytes = file[..4000].to_vec();
        for _ in 0..4 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let (at, value) = ((state >> 33) as usize % 2500, (state >> 25) as u8);
            bytes[at] = value;
        }
        refused += u32::from(Tiff::parse(&bytes).is_err());
    }
    assert_eq!(refused, 400, "a file of 4000 bytes does not hold the image");
}
