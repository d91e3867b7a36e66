//! Spectra of the ECOSTRESS library: text with `Key: value` lines, then two columns.

use crate::envi::LibrarySpectrum;

/// A text that is not a spectrum.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("line {line}: {rule}")]
pub struct EcostressError {
    /// From 1.
    pub line: usize,
    /// What was found and what was expected.
    pub rule: String,
}

/// Reads one file. Its header selects wavelengths in µm or nm and reflectances as fractions or per cent.
pub fn parse(text: &str) -> Result<LibrarySpectrum, EcostressError> {
    let mut spectrum = LibrarySpectrum { name: String::new(), wavelengths_nm: Vec::new(), reflectances: Vec::new() };
    let (mut to_nm, mut full_scale) = (None, None);
    for (line, number) in text.lines().zip(1..) {
        let error = |rule: &str| EcostressError { line: number, rule: format!("{:?}; {rule}", line.trim()) };
        if let Some((key, value)) = line.split_once(':') {
            let value = value.trim();
            let lower = value.to_ascii_lowercase();
            match key.trim().to_ascii_lowercase().as_str() {
                "name" => spectrum.name = value.split_whitespace().collect::<Vec<_>>().join(" "),
                "x units" if lower.contains("micromet") || lower.contains("microns") => to_nm = Some(1000.0),
                "x units" if lower.contains("nanomet") => to_nm = Some(1.0),
                "x units" => return Err(error("expected micrometers or nanometers")),
                "y units" if lower.contains("percent") => full_scale = Some(100.0),
                "y units" if lower.contains("reflectance") => full_scale = Some(1.0),
                "y units" => return Err(error("expected reflectance")),
                _ => {}
            }
            continue;
        }
        if line.trim().is_empty() {
            continue;
        }
        let (Some(to_nm), Some(full_scale)) = (to_nm, full_scale) else {
            return Err(error("values must follow X Units and Y Units"));
        };
        let columns: Vec<f32> = line.split_whitespace().map_while(|text| text.parse().ok()).collect();
        let [wavelength, reflectance] = columns[..] else { return Err(error("expected two numbers")) };
        spectrum.wavelengths_nm.push(wavelength * to_nm);
        spectrum.reflectances.push(reflectance / full_scale);
    }
    let line = text.lines().count().max(1);
    if spectrum.wavelengths_nm.is_empty() {
        return Err(EcostressError { line, rule: "the file ends before the first value".to_owned() });
    }
    Ok(spectrum)
}
