//! Calibration files of units.

use crate::ouster::MetadataError;
use crate::velodyne::LaserFileError;

/// Error of a calibration file that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// The model has no calibration files.
    #[error("a {0} needs no calibration file; remove the entry")]
    NotNeeded(&'static str),
    /// The file of a Velodyne is invalid.
    #[error(transparent)]
    Lasers(#[from] LaserFileError),
    /// The metadata file of an Ouster is invalid.
    #[error(transparent)]
    Metadata(#[from] MetadataError),
    /// A line of a table of angles is invalid.
    #[error("line {line}: {text:?}; must be {rule}")]
    Angles {
        /// Line in the file.
        line: usize,
        /// The line found.
        text: String,
        /// Rule that the line breaks.
        rule: &'static str,
    },
    /// A table of angles has too few or too many lines.
    #[error("has {found} beams; a {model} has {expected}")]
    NumberOfBeams {
        /// Beams found.
        found: usize,
        /// The model.
        model: &'static str,
        /// Beams of the model.
        expected: usize,
    },
}

/// Direction of a beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BeamAngles {
    /// Angle above the horizon, deg.
    pub(crate) elevation_deg: f64,
    /// Added to the encoder angle, deg, clockwise.
    pub(crate) azimuth_deg: f64,
}

/// Angles of `n_expected` beams, one per line: `elevation, azimuth` in deg, after an optional number of the beam. Lines before the first
/// beam are a header.
pub(crate) fn angles_from_csv(
    text: &str,
    model: &'static str,
    n_expected: usize,
) -> Result<Vec<BeamAngles>, CalibrationError> {
    let mut angles = Vec::new();
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let fields: Vec<&str> = line.split(',').map(str::trim).filter(|field| !field.is_empty()).collect();
        if fields.is_empty() {
            continue;
        }
        let numbers: Option<Vec<f64>> = fields.iter().map(|field| field.parse().ok()).collect();
        let error = |rule| CalibrationError::Angles { line: index + 1, text: line.chars().take(60).collect(), rule };
        let Some(numbers) = numbers else {
            if angles.is_empty() {
                continue;
            }
            return Err(error("numbers separated by commas"));
        };
        let [elevation_deg, azimuth_deg] = match numbers[..] {
            [elevation, azimuth] => [elevation, azimuth],
            [number, elevation, azimuth] if number == (angles.len() + 1) as f64 => [elevation, azimuth],
            _ => return Err(error("elevation and azimuth of a beam, after an optional number that counts from 1")),
        };
        if !(elevation_deg.abs() <= 90.0 && azimuth_deg.abs() <= 180.0) {
            return Err(error("an elevation of -90 to 90 and an azimuth of -180 to 180 deg"));
        }
        if angles.len() < n_expected + 1 {
            angles.push(BeamAngles { elevation_deg, azimuth_deg });
        }
    }
    if angles.len() != n_expected {
        return Err(CalibrationError::NumberOfBeams { found: angles.len(), model, expected: n_expected });
    }
    Ok(angles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_read_with_and_without_header_and_numbers() {
        let expected =
            [(1.5, -2.0), (0.5, 2.0)].map(|(elevation_deg, azimuth_deg)| BeamAngles { elevation_deg, azimuth_deg });
        for text in
            ["Laser id,Elevation,Azimuth\n1,1.5,-2\n2,0.5,2\n", "1.5,-2.0\r\n0.5,2\r\n", "\n1, 1.5 , -2,\n2,0.5,2"]
        {
            assert_eq!(angles_from_csv(text, "X", 2).expect("reads"), expected);
        }
        let error = |text: &str| angles_from_csv(text, "X", 2).expect_err("is wrong").to_string();
        assert_eq!(error("1,1.5,-2\n"), "has 1 beams; a X has 2");
        assert_eq!(error("1,2\n3,4\n5,6\n7,8\n9,9\n"), "has 3 beams; a X has 2");
        assert!(error("1,1.5,-2\n3,0.5,2\n").starts_with("line 2: \"3,0.5,2\"; must be elevation"));
        assert!(error("91,0\n").contains("an elevation of -90 to 90"));
        assert!(error("1,2\nx,y\n").starts_with("line 2: \"x,y\"; must be numbers"));
    }
}
