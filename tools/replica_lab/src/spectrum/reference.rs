//! Comparison of signatures with reference spectra.

use anyhow::Context;
use files::regular_file;
use formats::ecostress;
use formats::envi::{self, LibrarySpectrum};
use pictures::bands::source::Source;
use serde::Serialize;
use std::path::Path;

/// Number of reference spectra that are reported.
const N_NEAREST: usize = 5;

/// A reference spectrum and its distance from the signature.
#[derive(Serialize)]
pub struct Match {
    /// Name in its library.
    pub name: String,
    /// Spectral angle, deg.
    pub angle_deg: f64,
}

/// All spectra of an ENVI library (`.sli`, `.hdr`) or of an ECOSTRESS file.
pub fn read(path: &Path) -> anyhow::Result<Vec<LibrarySpectrum>> {
    let is_text = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("txt"));
    if !is_text {
        return Ok(envi::read_library(path)?);
    }
    let about = || path.display().to_string();
    // Place names have unknown encodings; the numbers are ASCII.
    let text = String::from_utf8_lossy(&regular_file::read(path).with_context(about)?).into_owned();
    Ok(vec![ecostress::parse(&text).with_context(about)?])
}

/// Reflectance at a wavelength, linearly interpolated. `None` outside the samples.
pub fn at(spectrum: &LibrarySpectrum, nm: f32) -> Option<f64> {
    let mut samples: Vec<(f32, f32)> =
        spectrum.wavelengths_nm.iter().copied().zip(spectrum.reflectances.iter().copied()).collect();
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let after = samples.partition_point(|sample| sample.0 < nm);
    let (_, last) = samples.get(after)?;
    let first = samples.get(after.checked_sub(usize::from(after > 0))?)?;
    let a = first.0;
    let b = samples[after].0;
    if nm < a {
        return None;
    }
    let share = if b > a { (nm - a) / (b - a) } else { 0.0 };
    Some(f64::from(first.1 + (last - first.1) * share))
}

/// Spectral angle between a signature and a reference, rad (Kruse et al., 1993): 0 if they differ only by a factor. Uses the
/// channels at which both are known; `None` if these are fewer than three.
pub fn spectral_angle(wavelengths_nm: &[f32], signature: &[f64], reference: &LibrarySpectrum) -> Option<f64> {
    let pairs: Vec<(f64, f64)> = wavelengths_nm
        .iter()
        .zip(signature)
        .filter_map(|(nm, value)| Some((*value, at(reference, *nm)?)))
        .filter(|(a, b)| a.is_finite() && b.is_finite())
        .collect();
    if pairs.len() < 3 {
        return None;
    }
    let dot = |f: fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>();
    let ab = dot(|(a, b)| a * b);
    let aa = dot(|(a, _)| a * a);
    let bb = dot(|(_, b)| b * b);
    (aa > 0.0 && bb > 0.0).then(|| (ab / (aa * bb).sqrt()).clamp(-1.0, 1.0).acos())
}

/// The reference spectra nearest to the signature of the region, the nearest first.
pub fn nearest(source: &Source, references: &[LibrarySpectrum]) -> Vec<Match> {
    let wavelengths_nm: Vec<f32> = source.channels.iter().map(|channel| channel.wavelength_nm).collect();
    let means: Vec<f64> = (0..source.channels.len())
        .map(|channel| source.signature(channel).map_or(f64::NAN, |[mean, _]| mean))
        .collect();
    let mut matches: Vec<Match> = references
        .iter()
        .filter_map(|known| {
            let angle = spectral_angle(&wavelengths_nm, &means, known)?;
            Some(Match { name: known.name.clone(), angle_deg: angle.to_degrees() })
        })
        .collect();
    matches.sort_by(|a, b| a.angle_deg.total_cmp(&b.angle_deg));
    matches.truncate(N_NEAREST);
    matches
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spectral_angle_depends_on_shape_but_not_on_brightness() {
        let reference = LibrarySpectrum {
            name: "falling".into(),
            wavelengths_nm: vec![700.0, 500.0, 600.0],
            reflectances: vec![0.2, 0.6, 0.4],
        };
        assert!((at(&reference, 550.0).expect("inside") - 0.5).abs() < 1e-6);
        assert!((at(&reference, 500.0).expect("its end") - 0.6).abs() < 1e-6);
        assert_eq!((at(&reference, 499.0), at(&reference, 701.0)), (None, None));
        let wavelengths_nm = [450.0, 500.0, 600.0, 700.0];
        let angle =
            |signature: [f64; 4]| spectral_angle(&wavelengths_nm, &signature, &reference).expect("three channels");
        assert!(angle([9.0, 0.3, 0.2, 0.1]) < 1e-3, "half as bright, and one channel outside the reference");
        // (3, 2, 1) and (1, 2, 3): 10 / 14.
        assert!((angle([9.0, 0.1, 0.2, 0.3]) - (10.0_f64 / 14.0).acos()).abs() < 1e-4);
        assert_eq!(spectral_angle(&[500.0, 510.0], &[0.1, 0.2], &reference), None);
    }
}
