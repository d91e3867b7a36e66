//! Spectra of the ECOSTRESS library: text with `Key: value` lines, then two columns.

use crate::envi::LibrarySpectrum;

/// Error of a text that is not a spectrum.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("line {line}: {fault}")]
pub struct EcostressError {
    /// Line, from 1.
    pub line: usize,
    /// Fault of the line.
    pub fault: EcostressFault,
}

/// Fault of a text.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum EcostressFault {
    /// The unit of wavelengths is unknown.
    #[error("{0:?}; expected micrometers or nanometers")]
    WavelengthUnit(String),
    /// The unit of values is unknown.
    #[error("{0:?}; expected reflectance")]
    ValueUnit(String),
    /// Values precede the units.
    #[error("{0:?}; values must follow X Units and Y Units")]
    NoUnits(String),
    /// A line is not a value.
    #[error("{0:?}; expected two numbers")]
    Columns(String),
    /// The text has no values.
    #[error("the file ends before the first value")]
    NoValues,
}

/// Reads one file. Its header selects wavelengths in µm or nm and reflectances as fractions or per cent.
pub fn parse(text: &str) -> Result<LibrarySpectrum, EcostressError> {
    let mut spectrum = LibrarySpectrum { name: String::new(), wavelengths_nm: Vec::new(), reflectances: Vec::new() };
    let mut to_nm = None;
    let mut full_scale = None;
    for (line, number) in text.lines().zip(1..) {
        let error =
            |fault: fn(String) -> EcostressFault| EcostressError { line: number, fault: fault(line.trim().to_owned()) };
        if let Some((key, value)) = line.split_once(':') {
            let value = value.trim();
            let lower = value.to_ascii_lowercase();
            match key.trim().to_ascii_lowercase().as_str() {
                "name" => spectrum.name = value.split_whitespace().collect::<Vec<_>>().join(" "),
                "x units" if lower.contains("micromet") || lower.contains("microns") => to_nm = Some(1000.0),
                "x units" if lower.contains("nanomet") => to_nm = Some(1.0),
                "x units" => return Err(error(EcostressFault::WavelengthUnit)),
                "y units" if lower.contains("percent") => full_scale = Some(100.0),
                "y units" if lower.contains("reflectance") => full_scale = Some(1.0),
                "y units" => return Err(error(EcostressFault::ValueUnit)),
                _ => {}
            }
            continue;
        }
        if line.trim().is_empty() {
            continue;
        }
        let Some((to_nm, full_scale)) = to_nm.zip(full_scale) else {
            return Err(error(EcostressFault::NoUnits));
        };
        let columns: Vec<f32> = line.split_whitespace().map_while(|text| text.parse().ok()).collect();
        let [wavelength, reflectance] = columns[..] else { return Err(error(EcostressFault::Columns)) };
        spectrum.wavelengths_nm.push(wavelength * to_nm);
        spectrum.reflectances.push(reflectance / full_scale);
    }
    let line = text.lines().count().max(1);
    if spectrum.wavelengths_nm.is_empty() {
        return Err(EcostressError { line, fault: EcostressFault::NoValues });
    }
    Ok(spectrum)
}
