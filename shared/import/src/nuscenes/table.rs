//! Tables: JSON arrays of rows, up to a gigabyte, so rows are read one at a time.

use crate::error::{At, ImportError};
use files::regular_file;
use geometry::{Isometry3, Pose, Quaternion, UnitQuaternion};
use serde::de::{DeserializeOwned, Deserializer, Error, SeqAccess, Visitor};
use std::fmt;
use std::io::BufReader;
use std::marker::PhantomData;
use std::path::{Component, Path, PathBuf};

/// Largest deviation of a quaternion's norm from 1.
const NORM_TOLERANCE: f64 = 1e-3;

/// Passes each row of a table to `take`, which returns an error if the row is invalid.
pub(super) fn each_row<T: DeserializeOwned>(
    path: &Path,
    take: impl FnMut(T) -> Result<(), String>,
) -> Result<(), ImportError> {
    let file = regular_file::open(path).at(path)?;
    let mut json = serde_json::Deserializer::from_reader(BufReader::new(file));
    json.deserialize_seq(Rows { take, row: PhantomData }).at(path)?;
    json.end().at(path)
}

/// A path of a table, which must stay inside the folder.
pub(super) fn file_inside(source: &Path, name: &str) -> Result<PathBuf, String> {
    let stays = Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
    if stays && !name.is_empty() { Ok(source.join(name)) } else { Err(format!("filename {name:?} leaves the folder")) }
}

/// All rows of a small table.
pub(super) fn rows<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, ImportError> {
    let mut rows = Vec::new();
    each_row(path, |row| {
        rows.push(row);
        Ok(())
    })?;
    Ok(rows)
}

struct Rows<F, T> {
    take: F,
    row: PhantomData<T>,
}

impl<'de, T: DeserializeOwned, F: FnMut(T) -> Result<(), String>> Visitor<'de> for Rows<F, T> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an array of rows")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut rows: A) -> Result<(), A::Error> {
        while let Some(row) = rows.next_element()? {
            (self.take)(row).map_err(A::Error::custom)?;
        }
        Ok(())
    }
}

/// A pose from a translation in m and a rotation w x y z.
pub(super) fn pose(translation: [f64; 3], [w, x, y, z]: [f64; 4]) -> Result<Pose, String> {
    let quaternion = Quaternion::new(w, x, y, z);
    if (quaternion.norm() - 1.0).abs() > NORM_TOLERANCE {
        return Err(format!("rotation {:?} must be a unit quaternion w x y z", [w, x, y, z]));
    }
    Ok(Isometry3::from_parts(translation.into(), UnitQuaternion::from_quaternion(quaternion)))
}
