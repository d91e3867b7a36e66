//! Cubes, spectra and calibrations of mosaic cameras.

use crate::with_file;
use formats::envi;
use formats::sensor_calibration::SensorCalibration;
use std::fs;

/// A header and its data, separated by a byte 0.
pub(crate) fn envi(bytes: &[u8]) {
    envi_files(bytes, |header| {
        if let Ok(image) = envi::read(header) {
            let n = image.header.samples * image.header.lines * image.header.bands;
            assert!(image.values.len() == n && n <= bytes.len());
        }
    });
}

pub(crate) fn library(bytes: &[u8]) {
    envi_files(bytes, |header| {
        let _ = envi::read_library(header);
    });
}

fn envi_files(bytes: &[u8], read: impl FnOnce(&std::path::Path)) {
    let at = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let (header, data) = (&bytes[..at], bytes.get(at + 1..).unwrap_or_default());
    with_file(".hdr", header, |path| {
        let data_path = path.with_extension("sli");
        fs::write(&data_path, data).expect("writes");
        read(path);
        fs::remove_file(data_path).expect("removes");
    });
}

pub(crate) fn ecostress(bytes: &[u8]) {
    if let Ok(spectrum) = formats::ecostress::parse(&String::from_utf8_lossy(bytes)) {
        assert_eq!(spectrum.wavelengths_nm.len(), spectrum.reflectances.len());
    }
}

pub(crate) fn sensor_calibration(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    if let Err(error) = SensorCalibration::from_xml(&text) {
        assert!(!error.element.is_empty() && !error.rule.is_empty(), "{error}");
    }
}
