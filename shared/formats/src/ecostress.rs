//! Spectra of the ECOSTRESS library: a text of `Key: value` lines and two columns.

use crate::envi::LibrarySpectrum;

/// Why a text is no spectrum.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("line {line}: {rule}")]
pub struct EcostressError {
    /// From 1.
    pub line: usize,
    /// What was found and what must be there.
    pub rule: String,
}

/// Reads one file. Wavelengths in micrometres or nm, reflectances as fractions or per cent, as its head says.
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
                "x units" => return Err(error("must be micrometers or nanometers")),
                "y units" if lower.contains("percent") => full_scale = Some(100.0),
                "y units" if lower.contains("reflectance") => full_scale = Some(1.0),
                "y units" => return Err(error("must be reflectance")),
                _ => {}
            }
            continue;
        }
        if line.trim().is_empty() {
            continue;
        }
        let (Some(to_nm), Some(full_scale)) = (to_nm, full_scale) else {
            return Err(error("must come after X Units and Y Units"));
        };
        let columns: Vec<f32> = line.split_whitespace().map_while(|text| text.parse().ok()).collect();
        let [wavelength, reflectance] = columns[..] else { return Err(error("must be two numbers")) };
        spectrum.wavelengths_nm.push(wavelength * to_nm);
        spectrum.reflectances.push(reflectance / full_scale);
    }
    let line = text.lines().count().max(1);
    if spectrum.wavelengths_nm.is_empty() {
        return Err(EcostressError { line, rule: "no spectrum before the end".to_owned() });
    }
    Ok(spectrum)
}
