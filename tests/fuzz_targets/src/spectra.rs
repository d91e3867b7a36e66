//! Cubes, spectra and calibrations of mosaic cameras.

use crate::accepted::accepted;
use crate::scratch::{parts, with_files};
use formats::envi;
use formats::sensor_calibration::SensorCalibration;
use std::path::Path;

/// A header and its data, separated by a byte 0.
pub(crate) fn envi(bytes: &[u8]) {
    envi_files(bytes, |header| {
        let read = envi::read(header);
        accepted(&read);
        if let Ok(image) = read {
            let n = image.header.samples * image.header.lines * image.header.bands;
            assert!(image.values.len() == n && n <= bytes.len());
        }
    });
}

pub(crate) fn library(bytes: &[u8]) {
    envi_files(bytes, |header| {
        accepted(&envi::read_library(header));
    });
}

fn envi_files(bytes: &[u8], read: impl FnOnce(&Path)) {
    let [header, data] = parts(bytes);
    with_files(&[("a.hdr", header), ("a.sli", data)], |folder| read(&folder.join("a.hdr")));
}

pub(crate) fn ecostress(bytes: &[u8]) {
    let parsed = formats::ecostress::parse(&String::from_utf8_lossy(bytes));
    accepted(&parsed);
    if let Ok(spectrum) = parsed {
        assert_eq!(spectrum.wavelengths_nm.len(), spectrum.reflectances.len());
    }
}

pub(crate) fn sensor_calibration(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let read = SensorCalibration::from_xml(&text);
    accepted(&read);
    if let Err(error) = read {
        assert!(!error.element.is_empty() && !error.rule.is_empty(), "{error}");
    }
}
