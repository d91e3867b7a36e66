//! Calibration files of KITTI: lines of a key, a colon and numbers.

use crate::cameras::Projection;
use crate::error::{At, ImportError};
use files::text_file::{MAX_SETTINGS_BYTES, read_text};
use formats::trajectory::poses_from_kitti;
use geometry::{Isometry3, Pose};
use std::path::{Path, PathBuf};

/// A file.
pub(crate) struct Calibration {
    path: PathBuf,
    text: String,
}

impl Calibration {
    pub fn read(path: &Path) -> Result<Self, ImportError> {
        Ok(Self { path: path.to_owned(), text: read_text(path, MAX_SETTINGS_BYTES).at(path)? })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of the line, from 1, and words of an entry.
    fn entry(&self, key: &str) -> Result<(usize, Vec<&str>), ImportError> {
        let found = (1..).zip(self.text.lines()).find_map(|(line, text)| {
            let (name, value) = text.split_once(':')?;
            (name.trim() == key).then(|| (line, value.split_whitespace().collect()))
        });
        found.ok_or_else(|| ImportError::at(&self.path, format!("has no line {key}:")))
    }

    /// The numbers of an entry.
    pub fn numbers<const N: usize>(&self, key: &str) -> Result<[f64; N], ImportError> {
        let (line, words) = self.entry(key)?;
        let numbers = words.iter().map(|word| word.parse().ok().filter(|number: &f64| number.is_finite()));
        let numbers = numbers.collect::<Option<Vec<f64>>>().and_then(|numbers| numbers.try_into().ok());
        numbers.ok_or_else(|| ImportError::at_line(&self.path, line, format!("{key} must be {N} finite numbers")))
    }

    /// A rotation matrix, row by row.
    pub fn rotation(&self, key: &str) -> Result<Pose, ImportError> {
        let (line, r) = self.entry(key)?;
        let [a, b, c, d, e, f, g, h, i] = r[..] else {
            return Err(ImportError::at_line(&self.path, line, format!("{key} must be 9 numbers")));
        };
        self.rigid(line, key, [a, b, c, "0", d, e, f, "0", g, h, i, "0"])
    }

    /// A rotation matrix and a translation, entries `R` and `T`.
    pub fn transform(&self) -> Result<Pose, ImportError> {
        let rotation = self.rotation("R")?.rotation;
        let [x, y, z] = self.numbers("T")?;
        Ok(Isometry3::from_parts([x, y, z].into(), rotation))
    }

    /// The upper three rows of a rigid 4x4 matrix, row by row.
    pub fn matrix(&self, key: &str) -> Result<Pose, ImportError> {
        let (line, words) = self.entry(key)?;
        let rows = words.try_into();
        let rows = rows.map_err(|_| ImportError::at_line(&self.path, line, format!("{key} must be 12 numbers")))?;
        self.rigid(line, key, rows)
    }

    fn rigid(&self, line: usize, key: &str, rows: [&str; 12]) -> Result<Pose, ImportError> {
        let fault = |rule: String| ImportError::at_line(&self.path, line, format!("{key}: {rule}"));
        let poses = poses_from_kitti(&rows.join(" ")).map_err(|error| fault(error.fault.to_string()))?;
        poses.first().copied().ok_or_else(|| fault("must be 12 numbers".into()))
    }

    /// A projection of points of the rectified camera 0: K (I | t).
    pub fn projection(&self, key: &str) -> Result<Projection, ImportError> {
        let rows = self.numbers::<12>(key)?;
        let (line, _) = self.entry(key)?;
        Projection::from_rows(rows)
            .ok_or_else(|| ImportError::at_line(&self.path, line, format!("{key} {}", Projection::RULE)))
    }
}
