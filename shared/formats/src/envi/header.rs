//! The text header.

use super::error::{EnviFault, ValueRule};
use std::fmt::Write;

/// Order of the values in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interleave {
    /// Band-sequential.
    #[default]
    Bsq,
    /// Band-interleaved by line.
    Bil,
    /// Band-interleaved by pixel.
    Bip,
}

/// Data type of a value, with the code of ENVI. Complex types (6, 9) are not supported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are self-explanatory")]
pub enum DataType {
    U8 = 1,
    I16 = 2,
    I32 = 3,
    F32 = 4,
    F64 = 5,
    U16 = 12,
    U32 = 13,
    I64 = 14,
    U64 = 15,
}

impl DataType {
    const ALL: [Self; 9] =
        [Self::U8, Self::I16, Self::I32, Self::F32, Self::F64, Self::U16, Self::U32, Self::I64, Self::U64];

    /// Bytes of a value.
    pub const fn size(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 | Self::I64 | Self::U64 => 8,
        }
    }
}

/// Metadata of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Free text.
    pub description: String,
    /// Columns.
    pub samples: usize,
    /// Rows; 0 if the header has no entry.
    pub lines: usize,
    /// Number of bands.
    pub bands: usize,
    /// Bytes before the first value in the data file.
    pub header_offset: usize,
    /// Data type of the values in the data file.
    pub data_type: DataType,
    /// Order of the values in the data file.
    pub interleave: Interleave,
    /// Whether values are big-endian.
    pub is_big_endian: bool,
    /// Wavelength of each band (or of each sample of a library), in `wavelength_units`.
    pub wavelengths: Vec<f64>,
    /// Unit as written in the header; see [`Header::wavelengths_nm`].
    pub wavelength_units: String,
    /// Full width at half maximum of each band, in `wavelength_units`.
    pub fwhm: Vec<f64>,
    /// Name of each band.
    pub band_names: Vec<String>,
    /// Name of each spectrum of a library.
    pub spectra_names: Vec<String>,
    /// Stored value of a reflectance of 1.
    pub reflectance_scale_factor: Option<f32>,
    /// Value of pixels without data.
    pub data_ignore_value: Option<f32>,
}

impl Header {
    /// The header of a band-sequential image of f32 values.
    pub fn new(samples: usize, lines: usize, bands: usize) -> Self {
        Self {
            description: String::new(),
            samples,
            lines,
            bands,
            header_offset: 0,
            data_type: DataType::F32,
            interleave: Interleave::Bsq,
            is_big_endian: false,
            wavelengths: Vec::new(),
            wavelength_units: String::new(),
            fwhm: Vec::new(),
            band_names: Vec::new(),
            spectra_names: Vec::new(),
            reflectance_scale_factor: None,
            data_ignore_value: None,
        }
    }

    /// The wavelengths in nm. Without a unit, numbers above 100 are nm and others µm.
    pub fn wavelengths_nm(&self) -> Result<Vec<f32>, EnviFault> {
        let unit = self.wavelength_units.to_ascii_lowercase();
        let factor = match unit.as_str() {
            "nm" | "nanometers" | "nanometres" => 1.0,
            "um" | "µm" | "micrometers" | "micrometres" | "microns" => 1000.0,
            "" | "unknown" => {
                if self.wavelengths.iter().all(|value| *value > 100.0) {
                    1.0
                } else {
                    1000.0
                }
            }
            _ => return Err(EnviFault::WavelengthUnits(self.wavelength_units.clone())),
        };
        Ok(self.wavelengths.iter().map(|value| (value * factor) as f32).collect())
    }

    /// Parses the text. An error contains its line, from 1, if it has one.
    pub(super) fn parse(text: &str) -> Result<Self, (Option<usize>, EnviFault)> {
        let mut lines = text.lines().zip(1..);
        // Some programs write a byte order mark.
        let magic = lines.next().map_or("", |(line, _)| line.trim_start_matches('\u{feff}').trim());
        if magic != "ENVI" {
            return Err((Some(1), EnviFault::Magic(magic.to_owned())));
        }
        let mut header = Self::new(0, 0, 1);
        let mut seen = [false; 2];
        while let Some((line, number)) = lines.next() {
            let line = line.trim();
            if line.is_empty() || line.starts_with(';') {
                continue;
            }
            let Some((key, value)) = line.split_once('=') else {
                return Err((Some(number), EnviFault::NotAnEntry(line.to_owned())));
            };
            let mut value = value.trim().to_owned();
            if value.starts_with('{') {
                while !value.ends_with('}') {
                    let Some((more, _)) = lines.next() else {
                        return Err((Some(number), EnviFault::OpenList(key.trim().to_owned())));
                    };
                    value.push('\n');
                    value.push_str(more.trim_end());
                }
                value = String::from(value[1..value.len() - 1].trim());
            }
            // Keys may be in any case and with any number of blanks: `Header  Offset`.
            let key = key.split_whitespace().collect::<Vec<_>>().join(" ").to_ascii_lowercase();
            match key.as_str() {
                "samples" => seen[0] = true,
                "data type" => seen[1] = true,
                _ => {}
            }
            if let Err(rule) = header.set(&key, &value) {
                return Err((Some(number), EnviFault::Value { key, value, rule }));
            }
        }
        for (key, seen) in ["samples", "data type"].into_iter().zip(seen) {
            if !seen {
                return Err((None, EnviFault::Missing(key)));
            }
        }
        Ok(header)
    }

    fn set(&mut self, key: &str, value: &str) -> Result<(), ValueRule> {
        // No image has 2^31 values in a row.
        let size = |least: usize| {
            let number = value.parse::<usize>().ok().filter(|number| (least..=1 << 31).contains(number));
            number.ok_or(ValueRule::Integer(least))
        };
        let one_number = || value.parse::<f32>().map_err(|_| ValueRule::Number);
        match key {
            "description" => value.clone_into(&mut self.description),
            "samples" => self.samples = size(1)?,
            "lines" => self.lines = size(1)?,
            "bands" => self.bands = size(1)?,
            "header offset" => self.header_offset = size(0)?,
            "data type" => {
                let known = DataType::ALL.into_iter().find(|kind| value.parse() == Ok(*kind as u32));
                self.data_type = known.ok_or(ValueRule::OneOf("1, 2, 3, 4, 5, 12, 13, 14 or 15"))?;
            }
            "interleave" => {
                self.interleave = match value.to_ascii_lowercase().as_str() {
                    "bsq" => Interleave::Bsq,
                    "bil" => Interleave::Bil,
                    "bip" => Interleave::Bip,
                    _ => return Err(ValueRule::OneOf("bsq, bil or bip")),
                }
            }
            "byte order" => {
                self.is_big_endian = match value {
                    "0" => false,
                    "1" => true,
                    _ => return Err(ValueRule::OneOf("0 or 1")),
                }
            }
            "wavelength" => self.wavelengths = numbers(value)?,
            "fwhm" => self.fwhm = numbers(value)?,
            "wavelength units" => value.clone_into(&mut self.wavelength_units),
            "band names" => self.band_names = names(value),
            "spectra names" => self.spectra_names = names(value),
            "reflectance scale factor" => {
                self.reflectance_scale_factor = Some(one_number()?).filter(|factor| *factor > 0.0);
            }
            "data ignore value" => self.data_ignore_value = Some(one_number()?),
            _ => {}
        }
        Ok(())
    }

    /// The header text of a band-sequential, little-endian f32 image with the sizes and names of this header.
    pub(super) fn text(&self) -> String {
        let mut text = String::from("ENVI\n");
        let plain = |text: &str| text.replace(['{', '}'], " ");
        let listed =
            |names: &[String]| names.iter().map(|name| plain(name).replace(',', ";")).collect::<Vec<_>>().join(", ");
        let joined = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
        // Writing to a string cannot fail.
        let mut line = |key: &str, value: String| {
            let _ = writeln!(text, "{key} = {value}");
        };
        if !self.description.is_empty() {
            line("description", format!("{{{}}}", plain(&self.description)));
        }
        line("samples", self.samples.to_string());
        line("lines", self.lines.to_string());
        line("bands", self.bands.to_string());
        line("header offset", "0".to_owned());
        line("file type", "ENVI Standard".to_owned());
        line("data type", (DataType::F32 as u32).to_string());
        line("interleave", "bsq".to_owned());
        line("byte order", "0".to_owned());
        if let Some(factor) = self.reflectance_scale_factor {
            line("reflectance scale factor", factor.to_string());
        }
        if let Some(value) = self.data_ignore_value {
            line("data ignore value", value.to_string());
        }
        if !self.wavelengths.is_empty() {
            line("wavelength units", self.wavelength_units.clone());
            line("wavelength", format!("{{{}}}", joined(&self.wavelengths)));
        }
        if !self.fwhm.is_empty() {
            line("fwhm", format!("{{{}}}", joined(&self.fwhm)));
        }
        if !self.band_names.is_empty() {
            line("band names", format!("{{{}}}", listed(&self.band_names)));
        }
        text
    }
}

fn numbers(value: &str) -> Result<Vec<f64>, ValueRule> {
    let texts = value.split([',', '\n']).map(str::trim).filter(|text| !text.is_empty());
    texts.map(|text| text.parse().map_err(|_| ValueRule::Numbers(text.to_owned()))).collect()
}

fn names(value: &str) -> Vec<String> {
    value
        .split(',')
        .map(|name| name.split_whitespace().collect::<Vec<_>>().join(" "))
        .filter(|name| !name.is_empty())
        .collect()
}
