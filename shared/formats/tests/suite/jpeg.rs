//! Damaged JPEG files: decoders return an image for nearly all of them.

use formats::jpeg::{JpegError, check, is_jpeg};
use image::codecs::jpeg::JpegEncoder;
use random::Random;
use std::path::{Path, PathBuf};

/// A street: sky, facade with windows, noise of the sensor.
fn street() -> Vec<u8> {
    let mut random = Random::new(4);
    let image = image::RgbImage::from_fn(320, 200, |x, y| {
        let noise = random.index(12) as u8;
        match (y < 60, (x / 13 + y / 17) % 3) {
            (true, _) => image::Rgb([120 + noise, 150 + noise, 220]),
            (_, 0) => image::Rgb([40, 44 + noise, 60 + noise]),
            _ => image::Rgb([150 + noise, 110 + noise, (x / 2) as u8]),
        }
    });
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 85).encode_image(&image).expect("encodes");
    bytes
}

/// Offset of the image data after the header of the scan.
fn data_at(bytes: &[u8]) -> usize {
    bytes.windows(2).position(|pair| pair == [0xff, 0xda]).expect("a scan") + 14
}

/// Adds a restart interval to the header only: the image then claims several strips.
fn with_restart_interval(bytes: &[u8], interval: u16) -> Vec<u8> {
    let at = bytes.windows(2).position(|pair| pair == [0xff, 0xda]).expect("a scan");
    let segment = [&[0xff, 0xdd, 0, 4][..], &interval.to_be_bytes()].concat();
    [&bytes[..at], &segment, &bytes[at..]].concat()
}

#[test]
fn whole_jpeg_passes_and_each_cut_is_found() {
    let whole = street();
    assert!(is_jpeg(&whole));
    assert_eq!(check(&whole), Ok(()));
    assert_eq!(check(&[&whole[..], b"past the end"].concat()), Ok(()));
    for length in (0..whole.len()).step_by(37) {
        assert_eq!(check(&whole[..length]), Err(JpegError::Cut { n_bytes: length }));
    }
}

#[test]
fn rest_missing_before_the_end_marker_is_found() {
    let whole = street();
    let end = whole.len() - 2;
    for from in (data_at(&whole)..end - 40).step_by(97) {
        let rest = [&whole[..from], &whole[end..]].concat();
        assert!(check(&rest).is_err(), "from {from} of {end}");
    }
}

/// The share of damaged files that is detected. `damage` changes the data after an offset.
fn found_share(damage: impl Fn(&[u8], usize, &mut Random) -> Vec<u8>) -> f64 {
    let whole = street();
    let begin = data_at(&whole);
    let mut random = Random::new(9);
    let n = 500;
    let is_found = |random: &mut Random| {
        let at = begin + random.index(whole.len() - begin - 600);
        check(&damage(&whole, at, random)).is_err()
    };
    (0..n).filter(|_| is_found(&mut random)).count() as f64 / f64::from(n)
}

/// Undetected damage decodes to as many blocks as the data that it replaces: the decoder loses these blocks and at most the
/// brightness of the following ones.
#[test]
fn damage_in_the_middle_is_found_in_nine_of_ten_files() {
    let noise = found_share(|whole, at, random| {
        let mut damaged = whole.to_vec();
        damaged[at..at + 64].fill_with(|| random.bits() as u8);
        damaged
    });
    // A disk that lost a sector returns zeros.
    let zeros = found_share(|whole, at, _| [&whole[..at], &[0; 512], &whole[at + 512..]].concat());
    let lost = found_share(|whole, at, _| [&whole[..at], &whole[at + 512..]].concat());
    println!("found: noise {noise}, zeros {zeros}, lost {lost}");
    assert!(noise >= 0.9 && zeros >= 0.9 && lost >= 0.9, "noise {noise}, zeros {zeros}, lost {lost}");
}

fn jpegs(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            jpegs(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "jpg") {
            found.push(path);
        }
    }
}

#[real_data::test("bsds500/*.jpg", "nuscenes/*.jpg")]
fn real_jpegs_pass_and_real_damage_is_found() {
    let mut files = Vec::new();
    for folder in ["bsds500", "nuscenes"] {
        jpegs(&real_data::path(folder), &mut files);
    }
    assert!(files.len() > 100, "{}", files.len());
    let mut n_found = 0;
    let mut random = Random::new(3);
    for path in &files {
        let mut bytes = std::fs::read(path).expect("reads");
        assert_eq!(check(&bytes), Ok(()), "{}", path.display());
        let at = data_at(&bytes) + random.index(bytes.len() - data_at(&bytes) - 64);
        bytes[at..at + 64].fill_with(|| random.bits() as u8);
        n_found += usize::from(check(&bytes).is_err());
    }
    println!("{n_found} of {} damaged files found", files.len());
    assert!(n_found * 10 >= files.len() * 9, "{n_found} of {}", files.len());
}

#[test]
fn missing_restart_markers_are_found() {
    let bytes = with_restart_interval(&street(), 100);
    let found = check(&bytes);
    assert!(matches!(found, Err(JpegError::Long { .. })), "{found:?}");
    let whole = with_restart_interval(&street(), u16::MAX);
    assert_eq!(check(&whole), Ok(()), "an interval longer than the image");
}

#[test]
fn other_kinds_of_jpeg_are_left_to_the_decoder() {
    let mut progressive = street();
    let at = progressive.windows(2).position(|pair| pair == [0xff, 0xc0]).expect("a frame");
    progressive[at + 1] = 0xc2;
    let middle = progressive.len() / 2;
    progressive[middle..middle + 64].fill(0);
    assert_eq!(check(&progressive), Ok(()));
}
